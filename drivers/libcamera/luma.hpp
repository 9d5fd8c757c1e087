// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace maplet::camera {

/// Where the luma bytes lie in the first plane of a format.
struct LumaLayout {
  enum class Colours : std::uint8_t { kNone, kRgb, kBgr };

  std::size_t first = 0;             ///< byte of the first pixel of a row
  std::size_t step = 1;              ///< bytes from pixel to pixel
  Colours colours = Colours::kNone;  ///< no luma, but these in that order: it is made of them
};

/// Of a format by its four letters (little-endian, as V4L2 and DRM write them): planar and
/// semi-planar YUV, packed 4:2:2, 8-bit gray; 24-bit RGB for cameras that have nothing else.
/// @return nothing for what holds no luma
[[nodiscard]] std::optional<LumaLayout> luma_layout(std::uint32_t fourcc) noexcept;

struct LumaImage {
  std::span<const std::uint8_t> plane;
  std::size_t stride_bytes = 0;
  int width_px = 0;
  int height_px = 0;
};

/// @param to  width x height, row by row. @return false when the plane holds less than it says
[[nodiscard]] bool copy_luma(const LumaImage& image, const LumaLayout& layout,
                             std::span<std::uint8_t> to) noexcept;

}  // namespace maplet::camera
