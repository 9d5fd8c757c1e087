// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/sim/options.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

namespace maplet::sim {
namespace {

std::string key_names() {
  std::string names;
  for (const auto& field : SimOptions::kFields) {
    if (!names.empty()) names += ", ";
    names += field.key;
  }
  return names;
}

/// @return empty when `text` is a value of the field
std::string set(SimOptions& options, const Field<SimOptions>& field, const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool is_number = error == std::errc{} && end == text.data() + text.size();
  const bool whole = is_number && std::isfinite(value) && value == std::floor(value);
  if (const auto* flag = std::get_if<bool SimOptions::*>(&field.member)) {
    if (!whole || (value != 0.0 && value != 1.0)) {
      return fmt::format("sim: {}={}: expected 0 or 1", field.key, text);
    }
    options.*(*flag) = value != 0.0;
    return {};
  }
  const bool is_int = std::holds_alternative<int SimOptions::*>(field.member);
  if (!is_number || !(value >= field.min && value <= field.max) || (is_int && !whole)) {
    return fmt::format("sim: {}={}: expected {} from {} to {}", field.key, text,
                       is_int ? "a whole number" : "a number", field.min, field.max);
  }
  if (const auto* count = std::get_if<int SimOptions::*>(&field.member)) {
    options.*(*count) = static_cast<int>(value);
  } else if (const auto* real = std::get_if<double SimOptions::*>(&field.member)) {
    options.*(*real) = value;
  }
  return {};
}

}  // namespace

tl::expected<SimOptions, std::string> parse_options(
    const std::map<std::string, std::string>& parameters) {
  using Problem = tl::unexpected<std::string>;
  SimOptions options;
  for (const auto& [key, text] : parameters) {
    bool known = false;
    for (const auto& field : SimOptions::kFields) {
      if (field.key != key) continue;
      known = true;
      if (auto problem = set(options, field, text); !problem.empty()) return Problem{problem};
    }
    if (!known) return Problem{fmt::format("sim: no key '{}'; there are {}", key, key_names())};
  }
  if (options.width != 640 && options.width != 320 && options.width != 160) {
    return Problem{fmt::format("sim: width={}: expected 640, 320 or 160", options.width)};
  }
  if (options.min_m >= options.max_m) {
    return Problem{
        fmt::format("sim: min_m={} is not below max_m={}", options.min_m, options.max_m)};
  }
  return options;
}

std::string describe_options() {
  const SimOptions defaults;
  std::string text;
  for (const auto& field : SimOptions::kFields) {
    double value = 0.0;
    if (const auto* flag = std::get_if<bool SimOptions::*>(&field.member)) {
      value = defaults.*(*flag) ? 1.0 : 0.0;
    } else if (const auto* count = std::get_if<int SimOptions::*>(&field.member)) {
      value = defaults.*(*count);
    } else if (const auto* real = std::get_if<double SimOptions::*>(&field.member)) {
      value = defaults.*(*real);
    }
    text += fmt::format("  {:<20}{} (default {})\n", field.key, field.help, value);
  }
  return text;
}

}  // namespace maplet::sim
