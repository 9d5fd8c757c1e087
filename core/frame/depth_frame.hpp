// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/base/clock.hpp"
#include "core/frame/motion_hint.hpp"
#include "core/frame/noise_model.hpp"
#include "core/geometry/camera_model.hpp"
#include "core/geometry/se3.hpp"

namespace maplet {

/// Pixels on loan: whoever made the view says how long they live.
template <class Pixel>
struct ImageView {
  const Pixel* pixels = nullptr;  ///< row-major, top row first
  int width_px = 0;
  int height_px = 0;
  std::ptrdiff_t stride_px = 0;  ///< from one row to the next, in pixels

  [[nodiscard]] bool empty() const noexcept { return pixels == nullptr; }
  [[nodiscard]] const Pixel* row(int v) const noexcept { return pixels + v * stride_px; }
  [[nodiscard]] Pixel at(int u, int v) const noexcept { return row(v)[u]; }
};

/// A gray image of a camera of its own.
struct GrayBeside {
  ImageView<std::uint8_t> pixels;  ///< empty: there is none
  CameraModel camera;
  Se3 T_depth_gray;
};

/// One depth image, and the gray image registered to it when there is one.
///
/// Memory  a loan: valid until the source's next call.
struct DepthFrame {
  std::uint64_t index = 0;         ///< counts the source's frames, from 0
  Stamp stamp{};                   ///< the source's own time
  ImageView<std::uint16_t> depth;  ///< in units of metres_per_unit; 0 = no return
  double metres_per_unit = 0.001;
  CameraModel camera;  ///< of `depth`
  NoiseModel noise;
  ImageView<std::uint8_t> gray;  ///< same size and viewpoint as `depth`, or empty
  GrayBeside gray_beside;        ///< where the gray camera is not the depth camera
  MotionHint motion;
};

}  // namespace maplet
