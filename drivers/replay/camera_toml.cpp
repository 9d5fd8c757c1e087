// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/camera_toml.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <array>
#include <cmath>
#include <span>

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
///
/// @param numbers  width_px, height_px, fx_px, fy_px, cx_px, cy_px come first
/// @param other    other(key, node, where, taken): takes keys that are no numbers; false: not known
template <class Other>
tl::expected<CameraModel, std::string> take_table(const toml::table& table,
                                                  std::string_view section,
                                                  std::span<Number> numbers, std::string_view name,
                                                  Other&& other) {
  for (const auto& [toml_key, node] : table) {
    const std::string_view key = toml_key.str();
    const std::string where = fmt::format("{}:{}", name, node.source().begin.line);
    tl::expected<void, std::string> taken;
    if (!other(key, node, where, taken)) {
      Number* number = nullptr;
      for (Number& candidate : numbers) number = candidate.key == key ? &candidate : number;
      if (number == nullptr) {
        return Problem{fmt::format("{}: unknown key {}.{}: remove it, or see docs/recordings.md",
                                   where, section, key)};
      }
      taken = take(*number, node, where);
    }
    if (!taken) return Problem{taken.error()};
  }
  for (const Number& number : numbers) {
    if (!number.required || table.contains(number.key)) continue;
    return Problem{fmt::format("{}: {}.{} is missing: add it", name, section, number.key)};
  }
  const auto whole = [](double value) { return value == std::floor(value); };
  if (!whole(numbers[0].value) || !whole(numbers[1].value)) {
    return Problem{fmt::format("{}: width_px and height_px are whole numbers", name)};
  }
  const CameraModel camera{static_cast<int>(numbers[0].value),
                           static_cast<int>(numbers[1].value),
                           numbers[2].value,
                           numbers[3].value,
                           numbers[4].value,
                           numbers[5].value};
  if (!camera.valid()) return Problem{fmt::format("{}: fx_px and fy_px are not 0", name)};
  // tan 85 deg: nobody's depth camera sees more.
  constexpr double kWidest = 11.4;
  if (camera.width_px > 2.0 * kWidest * std::abs(camera.fx_px) ||
      camera.height_px > 2.0 * kWidest * std::abs(camera.fy_px)) {
    return Problem{fmt::format(
        "{}: {}.fx_px = {} and fy_px = {} mean a field of view beyond 170 degrees at {}x{}: "
        "correct them",
        name, section, camera.fx_px, camera.fy_px, camera.width_px, camera.height_px)};
  }
  return camera;
}

constexpr double kFarPx = 1e5;

tl::expected<RecordedCamera, std::string> take_depth(const toml::table& table,
                                                     std::string_view name) {
  Number numbers[] = {{"width_px", 1, kMaxWidthPx, true},   {"height_px", 1, kMaxHeightPx, true},
                      {"fx_px", -kFarPx, kFarPx, true},     {"fy_px", -kFarPx, kFarPx, true},
                      {"cx_px", -kFarPx, kFarPx, true},     {"cy_px", -kFarPx, kFarPx, true},
                      {"metres_per_unit", 1e-6, 1.0, true}, {"rate_hz", 0.01, 1000.0, false}};
  RecordedCamera out;
  const auto camera = take_table(
      table, "depth", numbers, name,
      [&](std::string_view key, const toml::node& node, const std::string& where, auto& taken) {
        if (key == "invalid_values") {
          taken = take(out.invalid_values, node, where);
        } else if (key == "registered_to_colour") {
          if (!node.is_boolean()) {
            taken = Problem{where + ": " + std::string{key} + ": true or false"};
          }
          out.registered_to_colour = node.value_or(false);
        } else {
          return false;
        }
        return true;
      });
  if (!camera) return Problem{camera.error()};
  out.camera = *camera;
  out.metres_per_unit = numbers[6].value;
  out.rate_hz = numbers[7].value;
  return out;
}

tl::expected<void, std::string> take(Se3& pose, const toml::node& node, std::string_view where) {
  const auto wrong = [&] {
    return Problem{fmt::format(
        "{}: T_depth_gray: expected [x, y, z, qx, qy, qz, qw], m, unit quaternion", where)};
  };
  const auto* list = node.as_array();
  if (list == nullptr || list->size() != 7) return wrong();
  std::array<double, 7> v{};
  for (std::size_t i = 0; i < v.size(); ++i) {
    const auto value = list->get(i)->is_number() ? list->get(i)->value<double>() : std::nullopt;
    if (!value || !(std::abs(*value) <= 10.0)) return wrong();
    v[i] = *value;
  }
  pose.t = {v[0], v[1], v[2]};
  pose.q = Eigen::Quaterniond{v[6], v[3], v[4], v[5]};
  if (!(std::abs(pose.q.norm() - 1.0) < 0.01)) return wrong();
  pose.q.normalize();
  return {};
}

tl::expected<RecordedGray, std::string> take_gray(const toml::table& table, std::string_view name) {
  Number numbers[] = {{"width_px", 1, kMaxWidthPx, true},   {"height_px", 1, kMaxHeightPx, true},
                      {"fx_px", -kFarPx, kFarPx, true},     {"fy_px", -kFarPx, kFarPx, true},
                      {"cx_px", -kFarPx, kFarPx, true},     {"cy_px", -kFarPx, kFarPx, true},
                      {"time_offset_s", -10.0, 10.0, false}};
  RecordedGray out;
  const auto camera = take_table(
      table, "gray", numbers, name,
      [&](std::string_view key, const toml::node& node, const std::string& where, auto& taken) {
        if (key != "T_depth_gray") return false;
        taken = take(out.T_depth_gray, node, where);
        return true;
      });
  if (!camera) return Problem{camera.error()};
  if (!table.contains("T_depth_gray")) {
    return Problem{fmt::format("{}: gray.T_depth_gray is missing: add it", name)};
  }
  out.camera = *camera;
  out.time_offset_s = numbers[6].value;
  return out;
}

}  // namespace

tl::expected<std::optional<RecordedGray>, std::string> parse_gray_toml(std::string_view text,
                                                                       std::string_view name) {
  try {
    const toml::table root = toml::parse(text);
    const toml::table* gray = root["gray"].as_table();
    if (gray == nullptr) return std::nullopt;
    auto taken = take_gray(*gray, name);
    if (!taken) return Problem{one_line(taken.error())};
    return *taken;
  } catch (const toml::parse_error& error) {
    return Problem{
        one_line(fmt::format("{}:{}: {}", name, error.source().begin.line, error.description()))};
  }
}

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
