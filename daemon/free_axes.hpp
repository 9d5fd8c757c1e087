// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "core/odometry/track.hpp"

namespace maplet::daemon {

/// Along what nothing was seen, as people read it: the worst axis of translation and of rotation,
/// camera frame, and how well the camera is known along them since its keyframe. Sigma 0: none.
struct FreeAxes {
  Eigen::Vector3d along = Eigen::Vector3d::Zero();  ///< unit
  double sigma_m = 0.0;
  Eigen::Vector3d about = Eigen::Vector3d::Zero();  ///< unit
  double sigma_rad = 0.0;

  void take_worse(const FreeAxes& other) noexcept {
    if (other.sigma_m > sigma_m) {
      sigma_m = other.sigma_m;
      along = other.along;
    }
    if (other.sigma_rad > sigma_rad) {
      sigma_rad = other.sigma_rad;
      about = other.about;
    }
  }
};

[[nodiscard]] inline FreeAxes free_axes_of(const Track& track) noexcept {
  constexpr double kPart = 0.5;  // of a unit tangent: a translation, a rotation, or both
  FreeAxes out;
  for (const Vector6d& axis : track.free_axes) {
    const Eigen::Vector3d rho = axis.head<3>();
    const Eigen::Vector3d theta = axis.tail<3>();
    FreeAxes one;
    if (rho.norm() > kPart) {
      one.along = rho.normalized();
      one.sigma_m = std::sqrt(one.along.dot(track.covariance.topLeftCorner<3, 3>() * one.along));
    }
    if (theta.norm() > kPart) {
      one.about = theta.normalized();
      one.sigma_rad =
          std::sqrt(one.about.dot(track.covariance.bottomRightCorner<3, 3>() * one.about));
    }
    out.take_worse(one);
  }
  return out;
}

}  // namespace maplet::daemon
