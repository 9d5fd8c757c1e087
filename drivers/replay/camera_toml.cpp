// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/camera_toml.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <cmath>

#include "core/limits.hpp"
#include "drivers/line.hpp"

namespace maplet {

namespace {

using Problem = tl::unexpected<std::string>;

struct Number {
  std::string_view key;
  double min, max;
  bool required;
  double value = 0.0;
};

tl::expected<void, std::string> take(Number& number, const toml::node& node,
                                     std::string_view where) {
  const auto value = node.is_number() ? node.value<double>() : std::nullopt;
  if (!value || !(*value >= number.min && *value <= number.max)) {
    return Problem{fmt::format("{}: {}: expected a number from {} to {}", where, number.key,
                               number.min, number.max)};
  }
  number.value = *value;
  return {};
}

tl::expected<void, std::string> take(InvalidValues& values, const toml::node& node,
                                     std::string_view where) {
  const auto* list = node.as_array();
  if (list == nullptr || list->size() > values.capacity()) {
    return Problem{fmt::format("{}: invalid_values: expected a list of at most {} numbers", where,
                               values.capacity())};
  }
  for (const auto& item : *list) {
    const auto value = item.is_integer() ? item.value<std::int64_t>() : std::nullopt;
    if (!value || *value < 0 || *value > 65535) {
      return Problem{
          fmt::format("{}: invalid_values: expected whole numbers from 0 to 65535", where)};
    }
    if (*value != 0) values.push_back(static_cast<std::uint16_t>(*value));
  }
  return {};
}

/// The table's keys one by one; what is not known is an error with its line.
tl::expected<RecordedCamera, std::string> take_depth(const toml::table& table,
                                                     std::string_view name) {
  constexpr double kFar = 1e5;
  Number numbers[] = {{"width_px", 1, kMaxWidthPx, true},   {"height_px", 1, kMaxHeightPx, true},
                      {"fx_px", -kFar, kFar, true},         {"fy_px", -kFar, kFar, true},
                      {"cx_px", -kFar, kFar, true},         {"cy_px", -kFar, kFar, true},
                      {"metres_per_unit", 1e-6, 1.0, true}, {"rate_hz", 0.01, 1000.0, false}};
  RecordedCamera out;
  for (const auto& [toml_key, node] : table) {
    const std::string_view key = toml_key.str();
    const std::string where = fmt::format("{}:{}", name, node.source().begin.line);
    tl::expected<void, std::string> taken;
    if (key == "invalid_values") {
      taken = take(out.invalid_values, node, where);
    } else if (key == "registered_to_colour") {
      if (!node.is_boolean()) taken = Problem{where + ": " + std::string{key} + ": true or false"};
      out.registered_to_colour = node.value_or(false);
    } else {
      Number* number = nullptr;
      for (Number& candidate : numbers) number = candidate.key == key ? &candidate : number;
      if (number == nullptr) return Problem{fmt::format("{}: unknown key depth.{}", where, key)};
      taken = take(*number, node, where);
    }
    if (!taken) return Problem{taken.error()};
  }
  for (const Number& number : numbers) {
    if (!number.required || table.contains(number.key)) continue;
    return Problem{fmt::format("{}: depth.{} is missing: add it", name, number.key)};
  }
  const auto whole = [](double value) { return value == std::floor(value); };
  if (!whole(numbers[0].value) || !whole(numbers[1].value)) {
    return Problem{fmt::format("{}: width_px and height_px are whole numbers", name)};
  }
  out.camera = {static_cast<int>(numbers[0].value),
                static_cast<int>(numbers[1].value),
                numbers[2].value,
                numbers[3].value,
                numbers[4].value,
                numbers[5].value};
  if (!out.camera.valid()) return Problem{fmt::format("{}: fx_px and fy_px are not 0", name)};
  out.metres_per_unit = numbers[6].value;
  out.rate_hz = numbers[7].value;
  return out;
}

}  // namespace

tl::expected<RecordedCamera, std::string> parse_camera_toml(std::string_view text,
                                                            std::string_view name) {
  try {
    const toml::table root = toml::parse(text);
    const toml::table* depth = root["depth"].as_table();
    if (depth == nullptr) return Problem{fmt::format("{}: no table [depth]: add it", name)};
    return take_depth(*depth, name).map_error(one_line);
  } catch (const toml::parse_error& error) {
    return Problem{
        one_line(fmt::format("{}:{}: {}", name, error.source().begin.line, error.description()))};
  }
}

}  // namespace maplet
