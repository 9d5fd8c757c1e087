// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/eval/trajectory.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>

namespace maplet::eval {
namespace {

constexpr std::string_view kBlanks = " \t\r";
constexpr double kUnitTolerance = 0.01;  // public truth files carry four decimals

[[nodiscard]] bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }

/// The next word of `rest`, which loses it; empty at the end of the line.
[[nodiscard]] std::string_view take_word(std::string_view& rest) noexcept {
  const auto begin = rest.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return rest = {};
  const auto end = std::min(rest.find_first_of(kBlanks, begin), rest.size());
  const std::string_view word = rest.substr(begin, end - begin);
  rest.remove_prefix(end);
  return word;
}

/// For a message: a file may hold anything.
[[nodiscard]] std::string printable(std::string_view word) {
  constexpr std::size_t kMost = 40;
  std::string text{word.substr(0, kMost)};
  std::ranges::replace_if(
      text, [](char c) { return c < ' ' || c > '~'; }, '?');
  return word.size() > kMost ? text + "..." : text;
}

[[nodiscard]] std::optional<double> parse_number(std::string_view word) noexcept {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(value)) return {};
  return value;
}

[[nodiscard]] StampedPose parse_line(std::string_view line) {
  std::string_view rest = line;
  const std::string_view stamp_word = take_word(rest);
  const auto stamp = parse_stamp(stamp_word);
  if (!stamp) {
    throw std::runtime_error{fmt::format("'{}' is no time in seconds", printable(stamp_word))};
  }
  std::array<double, 7> numbers{};
  for (double& number : numbers) {
    const std::string_view word = take_word(rest);
    if (word.empty()) throw std::runtime_error{"expected 8 numbers: stamp x y z qx qy qz qw"};
    const auto value = parse_number(word);
    if (!value) throw std::runtime_error{fmt::format("'{}' is no finite number", printable(word))};
    number = *value;
  }
  if (!take_word(rest).empty()) {
    throw std::runtime_error{"more than 8 numbers: stamp x y z qx qy qz qw"};
  }
  const auto [x, y, z, qx, qy, qz, qw] = numbers;
  const Eigen::Quaterniond q{qw, qx, qy, qz};
  if (std::abs(q.norm() - 1.0) > kUnitTolerance) {
    throw std::runtime_error{fmt::format("the quaternion's length is {:.3g}, not 1", q.norm())};
  }
  return {*stamp, Se3{q.normalized(), Eigen::Vector3d{x, y, z}}};
}

}  // namespace

std::optional<Stamp> parse_stamp(std::string_view text) noexcept {
  const bool negative = !text.empty() && text.front() == '-';
  if (negative || (!text.empty() && text.front() == '+')) text.remove_prefix(1);

  int exponent = 0;
  if (const auto e = text.find_first_of("eE"); e != std::string_view::npos) {
    std::string_view digits = text.substr(e + 1);
    if (!digits.empty() && digits.front() == '+') digits.remove_prefix(1);
    const auto [end, error] =
        std::from_chars(digits.data(), digits.data() + digits.size(), exponent);
    if (error != std::errc{} || end != digits.data() + digits.size()) return {};
    if (exponent < -30 || exponent > 30) return {};
    text = text.substr(0, e);
  }
  const auto point = std::min(text.find('.'), text.size());
  // Decimal digits until the nanosecond, counted from the first one.
  const std::ptrdiff_t wanted = static_cast<std::ptrdiff_t>(point) + exponent + 9;
  std::int64_t ns = 0;
  std::ptrdiff_t digits = 0;
  const auto push = [&](int digit) {
    if (digits++ >= wanted) return true;
    constexpr auto kMax = std::numeric_limits<std::int64_t>::max();
    if (ns > (kMax - digit) / 10) return false;
    ns = ns * 10 + digit;
    return true;
  };
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (i == point) continue;
    if (!is_digit(text[i]) || !push(text[i] - '0')) return {};
  }
  if (digits == 0) return {};
  while (digits < wanted) {
    if (!push(0)) return {};
  }
  return Stamp{negative ? -ns : ns};
}

Trajectory read_tum(std::istream& in, std::string_view name) {
  Trajectory poses;
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    const auto first = line.find_first_not_of(kBlanks);
    if (first == std::string::npos || line[first] == '#') continue;
    try {
      poses.push_back(parse_line(line));
    } catch (const std::runtime_error& e) {
      throw std::runtime_error{fmt::format("{}:{}: {}", name, number, e.what())};
    }
  }
  if (in.bad()) throw std::runtime_error{fmt::format("{}: reading failed", name)};
  std::ranges::stable_sort(poses, {}, &StampedPose::stamp);
  return poses;
}

Trajectory read_tum(const std::filesystem::path& file) {
  std::ifstream in{file};
  if (!in || std::filesystem::is_directory(file)) {
    throw std::runtime_error{fmt::format(
        "cannot read {}: give a file of lines 'stamp x y z qx qy qz qw'", file.string())};
  }
  return read_tum(in, file.string());
}

}  // namespace maplet::eval
