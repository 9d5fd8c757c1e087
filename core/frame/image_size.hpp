// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "core/limits.hpp"

namespace maplet {

struct ImageSize {
  int width_px = 0;
  int height_px = 0;

  [[nodiscard]] constexpr std::size_t pixels() const noexcept {
    return static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  }
  [[nodiscard]] constexpr bool holds(int other_width_px, int other_height_px) const noexcept {
    return other_width_px <= width_px && other_height_px <= height_px;
  }
  [[nodiscard]] constexpr ImageSize decimated(int step) const noexcept {
    return {(width_px + step - 1) / step, (height_px + step - 1) / step};
  }
  friend constexpr bool operator==(const ImageSize&, const ImageSize&) = default;
};

inline constexpr ImageSize kLargestImage{static_cast<int>(kMaxWidthPx),
                                         static_cast<int>(kMaxHeightPx)};

}  // namespace maplet
