// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/geometry/se3.hpp"

namespace maplet {

/// What others measured of the camera's motion, at a frame's time. Only differences between frames
/// count, so a frame that is skipped does no harm. Nobody has to believe it.
struct MotionHint {
  bool has_pose = false;
  /// External odometry: the camera in a frame of the odometry's own, drifting.
  Se3 T_external_camera;
  /// The covariances of all its steps since some moment, summed up, tangent of camera; zero = not
  /// said.
  Matrix6d path_covariance = Matrix6d::Zero();

  bool has_turn = false;
  /// Gyro: the rates integrated since some moment, camera's orientation in a frame of its own.
  Eigen::Quaterniond q_gyro_camera = Eigen::Quaterniond::Identity();
};

}  // namespace maplet
