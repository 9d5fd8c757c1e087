// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/clock.hpp"
#include "core/base/deadline.hpp"
#include "core/base/static_vector.hpp"
#include "core/geometry/se3.hpp"

namespace maplet {

/// Why a frame has no pose.
enum class Loss : std::uint8_t {
  kNone,
  kNoDepth,     ///< not one pixel with a return
  kCovered,     ///< depth in a few per cent of the image only: a covered lens, or nothing in range
  kFewPatches,  ///< hardly anything flat
  kFewInliers,  ///< what is seen does not fit the keyframes
  kInconsistent,  ///< it fits, but nothing moves like that
  kUnsure,        ///< after so long it may fit in many places: others are asked first
};
inline constexpr std::size_t kLosses = 7;

[[nodiscard]] constexpr std::string_view to_string(Loss loss) noexcept {
  constexpr std::string_view kNames[] = {"none",          "no depth",    "covered",
                                         "few patches",   "few inliers", "inconsistent motion",
                                         "not sure where"};
  return kNames[static_cast<std::size_t>(loss)];
}

/// Where the camera is, as the odometry knows it after one frame.
struct Track {
  enum class State : std::uint8_t {
    kTracking,
    kLost,  ///< poses are the last known ones: do not use
  };

  State state = State::kLost;
  Loss loss = Loss::kNone;  ///< of a lost frame: why
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
  bool gray = false;   ///< intensities took part
  bool leapt = false;  ///< the stamp is so far ahead that anything may have happened
  /// Where the camera jumped to an earlier segment: maps poses before into odometry's frame as it
  /// is from here on. The identity else.
  Se3 T_odom_before;
  std::uint32_t iterations = 0;
  Stop stop = Stop::kConverged;
  bool keyframe_due = false;  ///< this frame should become a keyframe
};

}  // namespace maplet
