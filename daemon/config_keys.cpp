// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The tables of fields as one list of keys: how a value of each type is read and written.
#include "daemon/config_keys.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <span>
#include <sstream>
#include <utility>

namespace maplet::daemon {

namespace {

/// How many of the key's unit a second has: the unit is the key's suffix.
double units_per_second(std::string_view key) {
  if (key.ends_with("_ns")) return 1e9;
  if (key.ends_with("_us")) return 1e6;
  if (key.ends_with("_ms")) return 1e3;
  return 1.0;
}

bool in_range(double value, double min, double max) { return value >= min && value <= max; }

bool is_choice(std::string_view choices, std::string_view value) {
  if (choices.empty()) return true;
  while (!choices.empty()) {
    const std::size_t bar = choices.find('|');
    if (choices.substr(0, bar) == value) return true;
    if (bar == std::string_view::npos) break;
    choices.remove_prefix(bar + 1);
  }
  return false;
}

// One pair of functions for each type a field may have. `set` returns false when the node's type or
// value does not fit; the caller says what would.
struct BoolValue {
  static bool set(bool& out, const toml::node& node, const auto&) {
    const auto value = node.value_exact<bool>();
    if (value) out = *value;
    return value.has_value();
  }
  static std::string print(bool value, const auto&) { return value ? "true" : "false"; }
  static std::string range(const auto&) { return "true or false"; }
};

struct IntValue {
  static bool set(int& out, const toml::node& node, const auto& field) {
    const auto value = node.value_exact<std::int64_t>();
    if (!value || !in_range(static_cast<double>(*value), field.min, field.max)) return false;
    if (!is_choice(field.choices, std::to_string(*value))) return false;
    out = static_cast<int>(*value);
    return true;
  }
  static std::string print(int value, const auto&) { return fmt::format("{}", value); }
  static std::string range(const auto& field) {
    if (!field.choices.empty()) return std::string{field.choices};
    return fmt::format("whole number {} .. {}", field.min, field.max);
  }
};

struct DoubleValue {
  static bool set(double& out, const toml::node& node, const auto& field) {
    const auto value = node.is_number() ? node.value<double>() : std::nullopt;
    if (!value || !in_range(*value, field.min, field.max)) return false;
    out = *value;
    return true;
  }
  static std::string print(double value, const auto&) {
    const std::string text = fmt::format("{}", value);
    return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
  }
  static std::string range(const auto& field) {
    return fmt::format("{} .. {}", field.min, field.max);
  }
};

struct DurationValue {
  static bool set(Duration& out, const toml::node& node, const auto& field) {
    double number = 0.0;
    if (!DoubleValue::set(number, node, field)) return false;
    out = Duration{std::llround(number * 1e9 / units_per_second(field.key))};
    return true;
  }
  static std::string print(Duration value, const auto& field) {
    return fmt::format("{}", seconds(value) * units_per_second(field.key));
  }
  static std::string range(const auto& field) { return DoubleValue::range(field); }
};

struct StringValue {
  static bool set(std::string& out, const toml::node& node, const auto& field) {
    const auto value = node.is_array() ? joined(*node.as_array(), field.key.starts_with("T_"))
                                       : node.value_exact<std::string>();
    if (!value || !is_choice(field.choices, *value)) return false;
    out = *value;
    return true;
  }
  /// Several words may be written as a list; of a pose, numbers.
  static std::optional<std::string> joined(const toml::array& list, bool numbers) {
    std::string all;
    for (const toml::node& item : list) {
      std::optional<std::string> word = item.value_exact<std::string>();
      if (numbers && item.is_number()) word = fmt::format("{}", *item.value<double>());
      if (!word) return {};
      all += (all.empty() ? "" : ",") + *word;
    }
    return all;
  }
  static std::string print(const std::string& value, const auto&) {
    std::ostringstream text;
    text << toml::value<std::string>{value};
    return text.str();
  }
  static std::string range(const auto& field) {
    return field.choices.empty() ? "text" : std::string{field.choices};
  }
};

struct VectorValue {
  static bool set(Vector3OrAuto& out, const toml::node& node, const auto& field) {
    if (node.value_exact<std::string>() == "auto") {
      out.reset();
      return true;
    }
    const toml::array* numbers = node.as_array();
    if (numbers == nullptr || numbers->size() != 3) return false;
    std::array<double, 3> vector{};
    double length = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      if (!DoubleValue::set(vector[i], *numbers->get(i), field)) return false;
      length += vector[i] * vector[i];
    }
    if (length == 0.0) return false;
    out = vector;
    return true;
  }
  static std::string print(const Vector3OrAuto& value, const auto& field) {
    if (!value) return "\"auto\"";
    return fmt::format("[{}, {}, {}]", DoubleValue::print((*value)[0], field),
                       DoubleValue::print((*value)[1], field),
                       DoubleValue::print((*value)[2], field));
  }
  static std::string range(const auto& field) {
    return fmt::format("\"auto\" or [x, y, z], not all 0, each {} .. {}", field.min, field.max);
  }
};

auto codec_of(bool) { return BoolValue{}; }
auto codec_of(int) { return IntValue{}; }
auto codec_of(double) { return DoubleValue{}; }
auto codec_of(Duration) { return DurationValue{}; }
auto codec_of(const std::string&) { return StringValue{}; }
auto codec_of(const Vector3OrAuto&) { return VectorValue{}; }

/// @param stage  Config -> that stage's config struct
template <class StageConfig, std::size_t N, class Access>
void add_section(std::vector<ConfigKey>& keys, std::string section,
                 std::span<const Field<StageConfig>, N> fields, Access stage) {
  for (const Field<StageConfig>& field : fields) {
    std::visit(
        [&](auto member) {
          using Value = std::decay_t<decltype(std::declval<StageConfig&>().*member)>;
          using Codec = decltype(codec_of(std::declval<const Value&>()));
          keys.push_back({section, std::string{field.key}, std::string{field.help},
                          Codec::range(field),
                          [=](Config& config, const toml::node& node) -> std::string {
                            if (Codec::set(stage(config).*member, node, field)) return {};
                            return "must be " + Codec::range(field);
                          },
                          [=](const Config& config) {
                            return Codec::print(stage(const_cast<Config&>(config)).*member, field);
                          }});
        },
        field.member);
  }
}

}  // namespace

/// A section of the file and the member of Config that it fills.
#define MAPLET_SECTION(name, path)                             \
  add_section(                                                 \
      keys, name, std::span{decltype(Config{}.path)::kFields}, \
      [](Config & c) -> auto& { return c.path; })

const std::vector<ConfigKey>& config_keys() {
  static const std::vector<ConfigKey> all = [] {
    std::vector<ConfigKey> keys;
    MAPLET_SECTION("", mission);  // first: TOML has keys without a section before all sections
    MAPLET_SECTION("input", input);
    MAPLET_SECTION("input", agent.decimator);
    MAPLET_SECTION("camera", camera);
    MAPLET_SECTION("gray_camera", gray);
    MAPLET_SECTION("body", body);
    MAPLET_SECTION("frame", agent.frame);
    MAPLET_SECTION("patches", agent.patches);
    MAPLET_SECTION("odometry", agent.odometry);
    MAPLET_SECTION("maplet", agent.maplet);
    MAPLET_SECTION("registration", agent.registration);
    MAPLET_SECTION("skeleton", agent.skeleton);
    MAPLET_SECTION("limits", agent.limits);
    MAPLET_SECTION("dds", dds);
    MAPLET_SECTION("dds", radio);
    MAPLET_SECTION("security", security);
    MAPLET_SECTION("exchange", exchange);
    MAPLET_SECTION("control", control);
    MAPLET_SECTION("journal", journal);
    MAPLET_SECTION("recorder", recorder);
    MAPLET_SECTION("realtime", realtime);
    MAPLET_SECTION("gpio", gpio);
    MAPLET_SECTION("ros2", ros2);
    MAPLET_SECTION("autopilot", autopilot);
    return keys;
  }();
  return all;
}

#undef MAPLET_SECTION

const ConfigKey* find_key(std::string_view section, std::string_view name) {
  for (const ConfigKey& key : config_keys()) {
    if (key.section == section && key.name == name) return &key;
  }
  return nullptr;
}

bool is_section(std::string_view section) {
  if (section.empty()) return false;
  for (const ConfigKey& key : config_keys()) {
    if (key.section == section) return true;
  }
  return false;
}

}  // namespace maplet::daemon
