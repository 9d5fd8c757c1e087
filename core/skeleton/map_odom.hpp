// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/geometry/se3.hpp"

namespace maplet {

/// Keeps what steers a robot smooth: odometry never jumps, and whatever the skeleton finds out
/// moves the frame that odometry lives in, T_map_odom, instead.
///
/// Memory   fixed, inside the object.
/// Time     O(1).
/// Math     docs/math/skeleton.md, eq. 27.
class MapOdom {
 public:
  /// More than this at the body is a jump, less is a correction that a controller may follow.
  struct Limits {
    double jump_m = 0.05;
    double jump_rad = 0.02;
  };

  MapOdom() noexcept : MapOdom{Limits{}} {}
  explicit MapOdom(const Limits& limits) noexcept : limits_{limits} {}

  /// Where the body is by the skeleton and by odometry alone, at the same moment.
  /// @return whether the frame jumped
  bool update(const Se3& T_map_body, const Se3& T_odom_body) noexcept {
    const Se3 next = T_map_body * T_odom_body.inverse();
    const Se3 moved = (T_map_odom_ * T_odom_body).inverse() * T_map_body;
    const bool jumped =
        known_ && (moved.t.norm() > limits_.jump_m || moved.angle() > limits_.jump_rad);
    T_map_odom_ = next;
    known_ = true;
    jumps_ += jumped ? 1 : 0;
    return jumped;
  }

  [[nodiscard]] const Se3& T_map_odom() const noexcept { return T_map_odom_; }
  /// How often the frame has jumped: who remembers places in the map looks them up again when this
  /// has changed.
  [[nodiscard]] std::uint64_t jumps() const noexcept { return jumps_; }

 private:
  Limits limits_;
  Se3 T_map_odom_;
  bool known_ = false;
  std::uint64_t jumps_ = 0;
};

}  // namespace maplet
