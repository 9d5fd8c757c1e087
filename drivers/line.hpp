// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <boost/static_string/static_string.hpp>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

namespace maplet {

inline constexpr std::size_t kMaxLineBytes = 400;

/// One line of text for people, cut at its capacity. Memory: no heap.
using Line = boost::static_string<kMaxLineBytes>;

template <class... Args>
[[nodiscard]] Line line(fmt::format_string<Args...> text, Args&&... args) {
  char buffer[kMaxLineBytes];
  const auto end = fmt::format_to_n(buffer, sizeof buffer, text, std::forward<Args>(args)...);
  return Line{buffer, std::min(end.size, sizeof buffer)};
}

/// The same text without what breaks a line or a terminal: names out of files may hold anything.
[[nodiscard]] inline std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return text;
}

[[nodiscard]] inline std::string_view view(const Line& line) noexcept {
  return {line.data(), line.size()};
}

}  // namespace maplet
