// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/frame/depth_frame.hpp"
#include "core/geometry/camera_model.hpp"

namespace maplet {

/// Every n-th pixel of a depth image: what a keyframe looks at its maplet's cells with, also when
/// it is taken into the next maplet.
///
/// Memory  fixed, 24 KB: lives in the arena.
struct DepthThumb {
  static constexpr int kMaxWidth = 128;
  static constexpr int kMaxHeight = 96;

  int step_px = 0;      ///< 0: there is none
  CameraModel camera;   ///< of the whole image
  float per_px = 1.0F;  ///< 1 / step_px
  int width = 0;
  int height = 0;
  float metres_per_unit = 0.001F;
  std::array<std::uint16_t, std::size_t{kMaxWidth} * kMaxHeight> depth;

  void clear() noexcept { step_px = 0; }
  void take(const DepthFrame& frame) noexcept;
  /// Depth at the sample nearest to a pixel inside the image, m; 0 = no return.
  [[nodiscard]] float at(float u_px, float v_px) const noexcept {
    const int i = static_cast<int>(u_px * per_px);
    const int j = static_cast<int>(v_px * per_px);
    if (i >= width || j >= height) return 0.0F;
    return static_cast<float>(depth[static_cast<std::size_t>(j * width + i)]) * metres_per_unit;
  }
};

}  // namespace maplet
