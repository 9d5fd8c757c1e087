// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace maplet {

/// A pinhole camera without distortion. Pixel (0, 0) is the centre of the top left pixel.
struct CameraModel {
  int width_px = 0;
  int height_px = 0;
  double fx_px = 0.0;
  double fy_px = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;

  /// Focal lengths may be negative (mirrored images), never zero or not finite.
  [[nodiscard]] bool valid() const noexcept {
    return width_px > 0 && height_px > 0 && std::isfinite(fx_px) && std::isfinite(fy_px) &&
           fx_px != 0.0 && fy_px != 0.0 && std::isfinite(cx_px) && std::isfinite(cy_px);
  }
  /// The ray (x/Z, y/Z, 1) of a pixel.
  [[nodiscard]] Eigen::Vector3d ray(double u_px, double v_px) const noexcept {
    return {(u_px - cx_px) / fx_px, (v_px - cy_px) / fy_px, 1.0};
  }
  /// The pixel of a point with z > 0, camera frame.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& p) const noexcept {
    return {fx_px * p.x() / p.z() + cx_px, fy_px * p.y() / p.z() + cy_px};
  }
  [[nodiscard]] bool contains(const Eigen::Vector2d& px) const noexcept {
    return px.x() >= -0.5 && px.y() >= -0.5 && px.x() < width_px - 0.5 && px.y() < height_px - 0.5;
  }
  /// The camera of an image that keeps every `step`-th pixel, beginning with pixel (0, 0).
  [[nodiscard]] CameraModel decimated(int step) const noexcept {
    return {(width_px + step - 1) / step,
            (height_px + step - 1) / step,
            fx_px / step,
            fy_px / step,
            cx_px / step,
            cy_px / step};
  }
};

}  // namespace maplet
