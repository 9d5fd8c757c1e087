// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/base/clock.hpp"
#include "core/base/deadline.hpp"
#include "core/base/static_vector.hpp"
#include "core/geometry/se3.hpp"

namespace maplet {

/// Where the camera is, as the odometry knows it after one frame.
struct Track {
  enum class State : std::uint8_t {
    kTracking,
    kLost,  ///< poses are the last known ones: do not use
  };

  State state = State::kLost;
  Stamp stamp{};
  std::uint32_t keyframe_id = 0;  ///< tracked against
  Transform<OdomFrame, CameraFrame> T_odom_camera;
  Transform<KeyframeFrame, CameraFrame> T_keyframe_camera;
  Matrix6d covariance = Matrix6d::Zero();  ///< of T_keyframe_camera; m^2, rad^2; tangent of camera
  /// Unit tangents (camera) that the scene does not constrain; the motion prior filled them.
  StaticVector<Vector6d, 6> free_axes;
  std::uint32_t inliers = 0;  ///< patches
  double overlap = 0.0;       ///< share of the frame's patch pixels that found their keyframe patch
  /// What the covariance was multiplied by because keyframes disagree (eq. 15).
  double disagreement = 1.0;
  bool gray = false;  ///< intensities took part
  std::uint32_t iterations = 0;
  Stop stop = Stop::kConverged;
  bool keyframe_due = false;  ///< this frame should become a keyframe
};

}  // namespace maplet
