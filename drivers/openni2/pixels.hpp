// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenNI.h>

#include <cstdint>
#include <span>

#include "drivers/source.hpp"

namespace maplet::openni2 {

/// How the runtime's image lies in ours.
struct Layout {
  int width_px;   ///< of the whole image
  int height_px;  ///< of the whole image
  bool mirrored;  ///< turn it back
};

/// The whole depth image from a frame: cropped parts in their place and 0 around, mirrored ones
/// turned back, invalid values 0.
/// @return false when the frame does not fit the layout or holds less than it says
[[nodiscard]] bool copy_depth(const openni::VideoFrameRef& frame, const Layout& layout,
                              const InvalidValues& invalid, std::span<std::uint16_t> to) noexcept;

/// Gray from RGB888 (luma of BT.601) or GRAY8.
[[nodiscard]] bool copy_gray(const openni::VideoFrameRef& frame, const Layout& layout,
                             std::span<std::uint8_t> to) noexcept;

}  // namespace maplet::openni2
