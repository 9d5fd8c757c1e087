// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry/camera_model.hpp"
#include "core/geometry/se3.hpp"
#include "drivers/sim/world.hpp"

namespace maplet::sim {

/// What each pixel sees: inverse depth and which surface.
///
/// Inverse depth of a plane is linear in the pixel: 1/Z = theta . (x, y, 1); so a span of a convex
/// polygon is one multiply-add a pixel, and the nearest surface has the largest value. Same result
/// as casting a ray through each pixel's centre.
///
/// Memory   one float and one int a pixel, made by the constructor; draw() allocates nothing.
/// Time     O(surfaces + drawn pixels).
class Raster {
 public:
  static constexpr std::int32_t kNothing = -1;

  Raster(const World& world, const CameraModel& camera);

  void draw(const Se3& T_world_camera) noexcept;

  [[nodiscard]] const float* inverse_depth() const noexcept { return inverse_.data(); }  ///< 1/m
  [[nodiscard]] const std::int32_t* surface() const noexcept { return surface_.data(); }

  /// 1/Z of a surface's plane at pixel (u, v): a u + b v + c.
  struct Linear {
    float a, b, c;
  };
  [[nodiscard]] const Linear& linear(std::int32_t surface) const noexcept {
    return linear_[static_cast<std::size_t>(surface)];
  }
  /// Distance of a surface's plane from the camera, m.
  [[nodiscard]] float distance(std::int32_t surface) const noexcept {
    return distance_[static_cast<std::size_t>(surface)];
  }

 private:
  void draw_surface(std::int32_t index, const Se3& T_camera_world) noexcept;

  const World* world_;
  CameraModel camera_;
  std::vector<float> inverse_;
  std::vector<std::int32_t> surface_;
  std::vector<Linear> linear_;
  std::vector<float> distance_;
};

}  // namespace maplet::sim
