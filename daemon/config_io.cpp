// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/config_io.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numeric>
#include <span>
#include <sstream>
#include <utility>
#include <vector>

namespace maplet::daemon {

namespace {

using Problem = std::string;  // empty = none

/// One key of any stage, without its type.
struct Key {
  std::string section;
  std::string name;
  std::string help;
  std::string range;  // as a person reads it
  std::function<Problem(Config&, const toml::node&)> set;
  std::function<std::string(const Config&)> print;

  [[nodiscard]] std::string full_name() const { return section + "." + name; }
};

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
    const auto value = node.is_array() ? joined(*node.as_array()) : node.value_exact<std::string>();
    if (!value || !is_choice(field.choices, *value)) return false;
    out = *value;
    return true;
  }
  /// Several words may be written as a list.
  static std::optional<std::string> joined(const toml::array& list) {
    std::string all;
    for (const toml::node& item : list) {
      const auto word = item.value_exact<std::string>();
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
void add_section(std::vector<Key>& keys, std::string section,
                 std::span<const Field<StageConfig>, N> fields, Access stage) {
  for (const Field<StageConfig>& field : fields) {
    std::visit(
        [&](auto member) {
          using Value = std::decay_t<decltype(std::declval<StageConfig&>().*member)>;
          using Codec = decltype(codec_of(std::declval<const Value&>()));
          keys.push_back({section, std::string{field.key}, std::string{field.help},
                          Codec::range(field),
                          [=](Config& config, const toml::node& node) -> Problem {
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

/// A section of the file and the member of Config that it fills.
#define MAPLET_SECTION(name, path)                             \
  add_section(                                                 \
      keys, name, std::span{decltype(Config{}.path)::kFields}, \
      [](Config & c) -> auto& { return c.path; })

const std::vector<Key>& all_keys() {
  static const std::vector<Key> all = [] {
    std::vector<Key> keys;
    MAPLET_SECTION("input", input);
    MAPLET_SECTION("input", agent.decimator);
    MAPLET_SECTION("camera", camera);
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
    MAPLET_SECTION("exchange", exchange);
    MAPLET_SECTION("control", control);
    return keys;
  }();
  return all;
}

#undef MAPLET_SECTION

const Key* find_key(std::string_view section, std::string_view name) {
  for (const Key& key : all_keys()) {
    if (key.section == section && key.name == name) return &key;
  }
  return nullptr;
}

bool is_section(std::string_view section) {
  for (const Key& key : all_keys()) {
    if (key.section == section) return true;
  }
  return false;
}

std::string at(std::string_view name, const toml::node& node) {
  return fmt::format("{}:{}", name, node.source().begin.line);
}

std::string on_one_line(const toml::node& value) {
  std::ostringstream shown;
  shown << toml::node_view<const toml::node>{value};
  std::string line;
  for (const char c : shown.str()) {
    const bool space = c == '\n' || c == ' ';
    if (!space) line += c;
    if (space && !line.empty() && line.back() != ' ') line += ' ';
  }
  return line;
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({changed, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

/// " (perhaps frame.budget_us)" when a key of some section is spelled nearly so.
std::string perhaps(std::string_view section, std::string_view name) {
  const Key* nearest = nullptr;
  std::size_t least = 3;
  for (const Key& key : all_keys()) {
    const std::size_t distance = edit_distance(key.name, name) + (key.section == section ? 0 : 1);
    if (distance < least) {
      least = distance;
      nearest = &key;
    }
  }
  return nearest == nullptr ? "" : fmt::format(" (perhaps {})", nearest->full_name());
}

tl::expected<void, ConfigError> apply(Config& config, const toml::table& root,
                                      std::string_view name) {
  for (const auto& [section, node] : root) {
    const toml::table* table = node.as_table();
    if (table == nullptr || !is_section(section.str())) {
      return tl::unexpected{
          fmt::format("{}: unknown {} '{}'; mapletd --print-config lists all keys", at(name, node),
                      table ? "section" : "key", section.str())};
    }
    for (const auto& [key_name, value] : *table) {
      const Key* key = find_key(section.str(), key_name.str());
      if (key == nullptr) {
        return tl::unexpected{fmt::format(
            "{}: unknown key '{}.{}'{}; mapletd --print-config lists all keys", at(name, value),
            section.str(), key_name.str(), perhaps(section.str(), key_name.str()))};
      }
      if (const Problem problem = key->set(config, value); !problem.empty()) {
        return tl::unexpected{fmt::format("{}: {} = {}: {}", at(name, value), key->full_name(),
                                          on_one_line(value), problem)};
      }
    }
  }
  return {};
}

}  // namespace

tl::expected<void, ConfigError> check_together(const Config& config) {
  const MapletConfig& maplet = config.agent.maplet;
  if (maplet.overlap_keyframes >= maplet.max_keyframes) {
    return tl::unexpected{
        fmt::format("maplet: overlap_keyframes = {} must be less than max_keyframes = {}",
                    maplet.overlap_keyframes, maplet.max_keyframes)};
  }
  const PatchConfig& patches = config.agent.patches;
  if (patches.cell_px > patches.max_node_px) {
    return tl::unexpected{fmt::format("patches: cell_px = {} must not be above max_node_px = {}",
                                      patches.cell_px, patches.max_node_px)};
  }
  const CameraConfig& camera = config.camera;
  const bool any = camera.width_px || camera.height_px || camera.fx_px != 0 || camera.fy_px != 0;
  const bool all = camera.width_px && camera.height_px && camera.fx_px != 0 && camera.fy_px != 0;
  if (any && !all) {
    return tl::unexpected<ConfigError>{
        "camera: width_px, height_px, fx_px and fy_px go together: give all four, or none"};
  }
  return {};
}

tl::expected<Config, ConfigError> parse_config(std::string_view text, std::string_view name) {
  Config config;
  try {
    const toml::table root = toml::parse(text, name);
    if (const auto applied = apply(config, root, name); !applied) {
      return tl::unexpected{applied.error()};
    }
  } catch (const toml::parse_error& e) {
    return tl::unexpected{
        fmt::format("{}:{}: not TOML: {}", name, e.source().begin.line, e.description())};
  }
  return config;
}

tl::expected<Config, ConfigError> load_config(const std::string& path) {
  std::ifstream file{path};
  if (!file || std::filesystem::is_directory(path)) {
    return tl::unexpected{path +
                          ": cannot be read; give --config a TOML file (mapletd "
                          "--print-config writes one)"};
  }
  const std::string text{std::istreambuf_iterator<char>{file}, {}};
  return parse_config(text, path);
}

tl::expected<void, ConfigError> set_key(Config& config, std::string_view assignment) {
  const std::string name = fmt::format("--set {}", assignment);
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos) {
    return tl::unexpected{name + ": must be key=value, as in --set frame.budget_us=15000"};
  }
  const std::string key{assignment.substr(0, equals)};
  const std::string value{assignment.substr(equals + 1)};
  toml::table root;
  try {
    root = toml::parse(key + " = " + value);
  } catch (const toml::parse_error&) {
    try {
      std::ostringstream quoted;
      quoted << toml::value<std::string>{value};
      root = toml::parse(key + " = " + quoted.str());
    } catch (const toml::parse_error& e) {
      return tl::unexpected{fmt::format("{}: {}", name, e.description())};
    }
  }
  auto applied = apply(config, root, name);
  return applied;
}

std::string print_config(const Config& config) {
  std::string text = "# mapletd configuration. All keys, with their ranges.\n";
  std::string section;
  for (const Key& key : all_keys()) {
    if (key.section != section) {
      section = key.section;
      text += fmt::format("\n[{}]\n", section);
    }
    text += fmt::format("# {} ({})\n{} = {}\n", key.help, key.range, key.name, key.print(config));
  }
  return text;
}

}  // namespace maplet::daemon
