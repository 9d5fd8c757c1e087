// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "daemon/map_view.hpp"
#include "daemon/pose_report.hpp"
#include "transport/ros2/topics.hpp"

namespace maplet::daemon {

/// The way so far, in the map: each pose hangs from the maplet that was the newest then, and moves
/// with it when a loop closes. When there is no more room every second one goes, and the rest are
/// twice as far apart.
///
/// Memory   so many poses, at construction. Threads  one.
class Ros2Path {
 public:
  explicit Ros2Path(std::size_t most);

  /// A tracked frame.
  void add(const PoseReport& report) noexcept;
  /// @return the poses as the map has them now, the newest last; valid until the next call
  [[nodiscard]] std::span<const RosPathPose> poses(const MapView& map) noexcept;
  [[nodiscard]] static std::size_t bytes(std::size_t most) noexcept {
    return most * (sizeof(Point) + sizeof(RosPathPose));
  }

 private:
  struct Point {
    std::int64_t stamp_ns;
    bool anchored;
    MapletKey anchor;
    Se3 T_anchor_base;
    Se3 T_world_base;  ///< as last known
  };
  [[nodiscard]] static Point point_of(const PoseReport& report) noexcept;

  std::vector<Point> points_;  ///< the last one is the newest frame's, and is replaced by the next
  std::vector<RosPathPose> poses_;
  Se3 T_map_world_;
  Se3 T_odom_base_last_;  ///< of the last one that stays
  double apart_ = 1.0;
};

}  // namespace maplet::daemon
