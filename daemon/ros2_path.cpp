// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/ros2_path.hpp"

namespace maplet::daemon {

namespace {

constexpr double kApartM = 0.05;
constexpr double kApartRad = 0.15;

}  // namespace

Ros2Path::Ros2Path(std::size_t most) : poses_(most) { points_.reserve(most); }

Ros2Path::Point Ros2Path::point_of(const PoseReport& r) noexcept {
  const Se3 T_map_base = r.enu_flu.T_map_odom * r.enu_flu.T_odom_base;
  return {r.stamp_ns, r.anchored, r.anchor, r.T_anchor_base, r.T_map_world.inverse() * T_map_base};
}

void Ros2Path::add(const PoseReport& report) noexcept {
  T_map_world_ = report.T_map_world;
  const Se3 moved = T_odom_base_last_.inverse() * report.enu_flu.T_odom_base;
  const bool stays =
      points_.empty() || moved.t.norm() > apart_ * kApartM || moved.angle() > apart_ * kApartRad;
  // The newest is always the last; it stays when the way to it is long enough.
  if (points_.size() < 2 || stays) {
    if (points_.size() == points_.capacity()) {
      std::size_t kept = 0;
      for (std::size_t i = 0; i < points_.size(); i += 2) points_[kept++] = points_[i];
      points_.resize(kept);
      apart_ *= 2.0;
    }
    points_.push_back(point_of(report));
  } else {
    points_.back() = point_of(report);
  }
  if (stays) T_odom_base_last_ = report.enu_flu.T_odom_base;
}

std::span<const RosPathPose> Ros2Path::poses(const MapView& map) noexcept {
  map.poses([this](const auto& pose_of) {
    for (std::size_t i = 0; i < points_.size(); ++i) {
      Point& p = points_[i];
      if (const Se3* anchor = p.anchored ? pose_of(p.anchor) : nullptr)
        p.T_world_base = *anchor * p.T_anchor_base;
      poses_[i] = {p.stamp_ns, T_map_world_ * p.T_world_base};
    }
  });
  return std::span{poses_}.first(points_.size());
}

}  // namespace maplet::daemon
