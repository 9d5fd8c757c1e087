// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/base/clock.hpp"
#include "core/geometry/se3.hpp"
#include "core/patches/patch.hpp"

namespace maplet {

/// A frame that others are tracked against, and that maplets are made of.
///
/// Memory  large (a PatchSet): lives in the tracker's pool; others get it by reference for the
///   duration of a call.
struct Keyframe {
  std::uint32_t id = 0;       ///< counts up from 0
  std::uint32_t segment = 0;  ///< counts losses: poses of different segments are tied only loosely
  /// Counts spells of config.lost_frames and more without a pose that ended with the view
  /// recognised: the same segment, but a maplet does not reach over one.
  std::uint32_t blind_spells = 0;
  Stamp stamp{};
  Transform<OdomFrame, CameraFrame> T_odom_camera;
  Se3 T_odom_before;  ///< Track::T_odom_before
  /// Of T_previous_this, tangent of this; after a loss the honest covariance of the gap.
  Matrix6d covariance = Matrix6d::Zero();
  PatchSet patches;
};

}  // namespace maplet
