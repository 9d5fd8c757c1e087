// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/patches/block.hpp"

namespace maplet {

/// A plane's inverse depth in a block, in steps: at its top left pixel, and per pixel.
struct LinearDepth {
  float corner, per_u, per_v;
  float per_limit;    ///< 1 / the distance from which on a pixel does not belong to it
  std::int32_t name;  ///< 0 to 254
};

/// The label of a pixel that no plane explains.
inline constexpr std::int32_t kNobody = 255;

/// Planes that one call takes at most.
inline constexpr int kMaxAssigned = 8;

/// Gives each pixel of a block of 8 x `rows` to the plane that explains it best: by the distance as
/// a share of the plane's limit.
///
/// @param labels  written, 8 a row, `labels_stride` apart: the plane's name, or kNobody
/// @param won     pixels of each plane are added
using AssignFunction = void (*)(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                                const DepthScale& scale, const LinearDepth* planes, int count,
                                std::uint8_t* labels, std::ptrdiff_t labels_stride,
                                std::uint32_t* won) noexcept;

/// All variants give the same labels.
void assign_block_plain(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                        const DepthScale& scale, const LinearDepth* planes, int count,
                        std::uint8_t* labels, std::ptrdiff_t labels_stride,
                        std::uint32_t* won) noexcept;

/// The fastest one that this processor runs.
[[nodiscard]] AssignFunction best_assign_function() noexcept;

}  // namespace maplet
