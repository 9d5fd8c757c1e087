// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

/// Every capacity that is part of a type. Capacities that a configuration chooses (limits.*,
/// skeleton.max_*) size arrays in the arena instead.
namespace maplet {

// A frame.
inline constexpr std::size_t kMaxWidthPx = 1280;
inline constexpr std::size_t kMaxHeightPx = 1024;
inline constexpr std::size_t kMaxPatches = 2048;     ///< quadtree leaves of one frame
inline constexpr std::size_t kMaxFrameCells = 6144;  ///< finest cells of the quadtree, padded
inline constexpr std::size_t kMaxFramePlanes = 128;  ///< merged planes of one frame

// A maplet.
inline constexpr std::size_t kMaxMapletPlanes = 128;
inline constexpr std::size_t kMaxMapletKeyframes = 32;
inline constexpr std::size_t kMaxMapletBytes = 65536;  ///< of an encoded maplet
inline constexpr std::size_t kMaxMapletCells =
    131072;                                ///< grid cells of all its planes, set or not
inline constexpr int kMaxGridCells = 256;  ///< a side of one plane's grid

static_assert(kMaxFramePlanes <= kMaxMapletPlanes * 2);
static_assert(kMaxFramePlanes <= kMaxPatches);
static_assert(kMaxMapletPlanes <= 255 && kMaxMapletKeyframes <= 255, "counted in a byte");
static_assert(kMaxMapletCells % 64 == 0);
static_assert(kMaxMapletCells >= std::size_t{kMaxGridCells} * kMaxGridCells);

}  // namespace maplet
