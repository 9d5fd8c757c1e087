// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <boost/static_string/static_string.hpp>
#include <cstddef>
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

[[nodiscard]] inline std::string_view view(const Line& line) noexcept {
  return {line.data(), line.size()};
}

}  // namespace maplet
