// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/sim/options.hpp"

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

std::string number(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

/// @return empty when `text` is a value of the field
std::string set(SimOptions& options, const Field<SimOptions>& field, const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool is_number = error == std::errc{} && end == text.data() + text.size();
  const bool whole = is_number && std::isfinite(value) && value == std::floor(value);
  const std::string where = "sim: " + std::string{field.key} + "=" + text + ": ";
  if (const auto* flag = std::get_if<bool SimOptions::*>(&field.member)) {
    if (!whole || (value != 0.0 && value != 1.0)) return where + "expected 0 or 1";
    options.*(*flag) = value != 0.0;
    return {};
  }
  const bool is_int = std::holds_alternative<int SimOptions::*>(field.member);
  if (!is_number || !(value >= field.min && value <= field.max) || (is_int && !whole)) {
    return where + "expected " + (is_int ? "a whole number" : "a number") + " from " +
           number(field.min) + " to " + number(field.max);
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
  SimOptions options;
  for (const auto& [key, text] : parameters) {
    bool known = false;
    for (const auto& field : SimOptions::kFields) {
      if (field.key != key) continue;
      known = true;
      if (auto problem = set(options, field, text); !problem.empty()) {
        return tl::unexpected<std::string>{std::move(problem)};
      }
    }
    if (!known) {
      return tl::unexpected<std::string>{"sim: unknown key '" + key + "'; there are " +
                                         key_names()};
    }
  }
  if (options.width != 640 && options.width != 320 && options.width != 160) {
    return tl::unexpected<std::string>{"sim: width=" + std::to_string(options.width) +
                                       ": expected 640, 320 or 160"};
  }
  if (options.min_m >= options.max_m) {
    return tl::unexpected<std::string>{"sim: min_m=" + number(options.min_m) +
                                       " is not below max_m=" + number(options.max_m)};
  }
  return options;
}

}  // namespace maplet::sim
