// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/extent.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace maplet {

namespace {

using Corners = std::array<Eigen::Vector2d, 4>;

/// The borders of the outer pixels, not their centres.
Corners corners_px(const Patch& patch) noexcept {
  const double left = patch.u_px - 0.5, top = patch.v_px - 0.5;
  const double right = left + patch.width_px, bottom = top + patch.height_px;
  return {Eigen::Vector2d{left, top}, Eigen::Vector2d{right, top}, Eigen::Vector2d{right, bottom},
          Eigen::Vector2d{left, bottom}};
}

/// Where a pixel's ray meets a plane. A corner may lie beyond the plane's horizon: it is drawn to a
/// hundredth of the plane's inverse distance instead.
Eigen::Vector3d on_plane(const Eigen::Vector3d& theta, const Eigen::Vector3d& ray) noexcept {
  const double inverse_depth = theta.dot(ray);
  return ray / std::max(inverse_depth, 0.01 * theta.norm());
}

}  // namespace

std::array<Eigen::Vector3d, 4> quadrangle(const Patch& patch, const CameraModel& camera) noexcept {
  std::array<Eigen::Vector3d, 4> out;
  const Corners corners = corners_px(patch);
  for (std::size_t k = 0; k < 4; ++k) {
    out[k] = on_plane(patch.theta, camera.ray(corners[k].x(), corners[k].y()));
  }
  return out;
}

PlaneExtent extent(const PatchSet& set, std::size_t plane) noexcept {
  std::array<Eigen::Vector2d, kMaxExtentCorners> directions, farthest;
  std::array<double, kMaxExtentCorners> reach;
  reach.fill(-1e300);
  for (std::size_t d = 0; d < kMaxExtentCorners; ++d) {
    // Between the axes: along them two corners of a rectangle are equally far.
    const double angle =
        2.0 * std::numbers::pi * (static_cast<double>(d) + 0.5) / kMaxExtentCorners;
    directions[d] = {std::cos(angle), std::sin(angle)};
  }
  bool any = false;
  for (const Patch& patch : set.patches) {
    if (patch.plane != static_cast<int>(plane)) continue;
    any = true;
    for (const Eigen::Vector2d& corner : corners_px(patch)) {
      for (std::size_t d = 0; d < kMaxExtentCorners; ++d) {
        const double along = directions[d].dot(corner);
        if (along <= reach[d]) continue;
        reach[d] = along;
        farthest[d] = corner;
      }
    }
  }
  PlaneExtent out;
  if (!any) return out;
  for (std::size_t d = 0; d < kMaxExtentCorners; ++d) {
    const std::size_t before = (d + kMaxExtentCorners - 1) % kMaxExtentCorners;
    if (farthest[d] == farthest[before]) continue;
    out.push_back(
        on_plane(set.planes[plane].theta, set.camera.ray(farthest[d].x(), farthest[d].y())));
  }
  return out;
}

}  // namespace maplet
