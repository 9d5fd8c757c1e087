// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/frame/depth_frame.hpp"
#include "core/patches/block.hpp"

namespace maplet {

/// A plane's inverse depth inside a cell, in steps: at its top left pixel, and per pixel.
struct LinearDepth {
  float corner, per_u, per_v;
};

/// Gives each pixel of a cell to the plane that explains it best within `limit_steps`.
///
/// @param names  of the planes; what is written for a pixel; 0xFF for none
/// @param out    an image of `out_stride` bytes a row, written inside the cell only
/// @param won    pixels of each plane
void assign_pixels(const ImageView<std::uint16_t>& depth, int u, int v, int columns, int rows,
                   const DepthScale& scale, float limit_steps, std::span<const LinearDepth> planes,
                   const std::uint8_t* names, std::uint8_t* out, int out_stride,
                   std::uint32_t* won) noexcept;

}  // namespace maplet
