// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

#include "core/agent/map_frame.hpp"
#include "core/base/field.hpp"
#include "core/patches/patch.hpp"

namespace maplet::daemon {

/// In which axes programs outside see poses. docs/frames.md, section "Outside".
enum class OutputFrame : std::uint8_t { kEnuFlu, kNedFrd, kCamera };
[[nodiscard]] OutputFrame output_frame_of(std::string_view name) noexcept;

/// A pose of the robot with its covariance, as programs outside are told it.
struct OutsidePose {
  Se3 T_odom_base;
  Matrix6d covariance = Matrix6d::Zero();  ///< of T_odom_base, tangent [rho; theta] of base
  Vector6d twist = Vector6d::Zero();       ///< m/s, rad/s, tangent of base
  Matrix6d twist_covariance = Matrix6d::Zero();
  Se3 T_map_odom;
};

/// From the camera's axes to those of the world outside: odometry's frame stands where the body
/// stood at the first tracked frame, level, x ahead; the map's is levelled in the same way at its
/// own origin.
///
/// Memory   a value. Threads  one.
class OutputFrames {
 public:
  /// @param up  in the camera's frame at start, or found in the first view
  OutputFrames(const Se3& T_body_camera, const Vector3OrAuto& up) noexcept;

  /// At the first tracked frame: decides which way is up. Later ones change nothing.
  void begin(const PatchSet& first_view) noexcept;
  /// Every frame: where the map is, whose it is.
  void follow(const MapFrame::Notice& map) noexcept;

  /// @param inside  of the camera: T_odom_camera, tangents of camera, T_map_odom of skeleton
  /// @return the same of the body in enu_flu
  [[nodiscard]] OutsidePose outside(const OutsidePose& inside) const noexcept;
  /// enu_flu: a pose in the skeleton's world, of something with axes of its own.
  [[nodiscard]] Se3 map_pose(const Se3& T_world_thing) const noexcept {
    return T_map_world_ * T_world_thing;
  }
  [[nodiscard]] const Se3& T_body_camera() const noexcept { return T_body_camera_; }

 private:
  Se3 T_body_camera_;
  Vector3OrAuto up_;
  bool begun_ = false;
  Se3 T_out_odom_;   ///< outside's odometry frame from inside's
  Se3 T_map_world_;  ///< the same of the map
  MapletKey map_{};
  bool map_known_ = false;
};

/// The same in other axes: y and z turned round, in both frames.
[[nodiscard]] OutsidePose to_ned_frd(const OutsidePose& enu_flu) noexcept;

}  // namespace maplet::daemon
