// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/clock.hpp"
#include "core/frame/motion_hint.hpp"

namespace maplet {

/// A moment of external odometry.
struct MotionPose {
  Stamp stamp{};
  Se3 T_external_camera;
  Matrix6d path_covariance = Matrix6d::Zero();  ///< MotionHint::path_covariance
};

/// Somewhere on the screw from a to b. @param share  0 at a, 1 at b; a little beyond is fine
[[nodiscard]] inline MotionHint between(const MotionPose& a, const MotionPose& b,
                                        double share) noexcept {
  MotionHint hint;
  hint.has_pose = true;
  const Vector6d step = (a.T_external_camera.inverse() * b.T_external_camera).log();
  hint.T_external_camera = a.T_external_camera * Se3::exp(share * step);
  hint.path_covariance = (1.0 - share) * a.path_covariance + share * b.path_covariance;
  return hint;
}

}  // namespace maplet
