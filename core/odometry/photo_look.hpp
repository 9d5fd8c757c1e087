// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "core/geometry/se3.hpp"
#include "core/odometry/gray_pyramid.hpp"
#include "core/odometry/photo_view.hpp"

namespace maplet {

/// Where a keyframe's points are looked for: an image, and the way from the keyframe's depth camera
/// to the camera that made it.
struct PhotoLook {
  static constexpr float kNearestM = 0.1F;  ///< of the gray camera

  Eigen::Matrix3f R;  ///< keyframe to depth camera
  Eigen::Vector3f t;
  Eigen::Matrix3f R_gray;  ///< depth camera to gray camera
  Eigen::Vector3f t_gray;
  const std::uint8_t* pixels;
  int width;
  float fx, fy, cx, cy;
  float u_end, v_end;  ///< of the pixels that have a neighbour to the right and below

  PhotoLook(const Se3& T_camera_reference, const Se3& T_gray_depth,
            const GrayPyramid::Level& image) noexcept
      : R{T_camera_reference.rotation().cast<float>()},
        t{T_camera_reference.t.cast<float>()},
        R_gray{T_gray_depth.rotation().cast<float>()},
        t_gray{T_gray_depth.t.cast<float>()},
        pixels{image.pixels},
        width{image.camera.width_px},
        fx{static_cast<float>(image.camera.fx_px)},
        fy{static_cast<float>(image.camera.fy_px)},
        cx{static_cast<float>(image.camera.cx_px)},
        cy{static_cast<float>(image.camera.cy_px)},
        u_end{static_cast<float>(image.camera.width_px - 1)},
        v_end{static_cast<float>(image.camera.height_px - 1)} {}

  /// Each point that is in the image: take(point, intensity there, its gradient by the position in
  /// the depth camera, that position, pixel).
  template <class Take>
  void visit(std::span<const PhotoPoint> points, Take&& take) const noexcept {
    for (const PhotoPoint& point : points) {
      const Eigen::Vector3f p = R * point.p + t;
      const Eigen::Vector3f g = R_gray * p + t_gray;
      if (!(g.z() > kNearestM)) continue;
      const float inverse = 1.0F / g.z();
      const float x = g.x() * inverse;
      const float y = g.y() * inverse;
      const float u = fx * x + cx;
      const float v = fy * y + cy;
      if (!(u >= 0.0F && v >= 0.0F && u < u_end && v < v_end)) continue;
      const int column = static_cast<int>(u);
      const int row = static_cast<int>(v);
      const float a = u - static_cast<float>(column);
      const float b = v - static_cast<float>(row);
      const std::uint8_t* q = pixels + row * width + column;
      const auto i00 = static_cast<float>(q[0]);
      const auto i10 = static_cast<float>(q[1]);
      const auto i01 = static_cast<float>(q[width]);
      const auto i11 = static_cast<float>(q[width + 1]);
      const float top = i00 + a * (i10 - i00);
      const float low = i01 + a * (i11 - i01);
      // Slopes of the bilinear surface through the four pixels, per unit of x/Z and y/Z.
      const float gu = fx * ((i10 - i00) + b * ((i11 - i01) - (i10 - i00)));
      const float gv = fy * (low - top);
      const Eigen::Vector3f by_gray{gu * inverse, gv * inverse, -(gu * x + gv * y) * inverse};
      take(point, top + b * (low - top), Eigen::Vector3f{R_gray.transpose() * by_gray}, p, u, v);
    }
  }
};

}  // namespace maplet
