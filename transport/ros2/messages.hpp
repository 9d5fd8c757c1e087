// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Between values and the C structs of ros2_msg.idl. Included by this folder's sources only.
#pragma once

#include <ros2_msg.h>

#include <cstddef>
#include <cstdint>

#include "core/geometry/se3.hpp"

namespace maplet {

[[nodiscard]] inline builtin_interfaces_msg_dds__Time_ to_ros_time(std::int64_t ns) noexcept {
  constexpr std::int64_t kSecond = 1'000'000'000;
  std::int64_t sec = ns / kSecond;
  std::int64_t rest = ns % kSecond;
  if (rest < 0) {
    rest += kSecond;
    --sec;
  }
  return {static_cast<std::int32_t>(sec), static_cast<std::uint32_t>(rest)};
}

[[nodiscard]] inline geometry_msgs_msg_dds__Pose_ to_ros(const Se3& T) noexcept {
  return {{T.t.x(), T.t.y(), T.t.z()}, {T.q.x(), T.q.y(), T.q.z(), T.q.w()}};
}

[[nodiscard]] inline geometry_msgs_msg_dds__Transform_ to_ros_transform(const Se3& T) noexcept {
  return {{T.t.x(), T.t.y(), T.t.z()}, {T.q.x(), T.q.y(), T.q.z(), T.q.w()}};
}

[[nodiscard]] inline geometry_msgs_msg_dds__Twist_ to_ros(const Vector6d& twist) noexcept {
  return {{twist[0], twist[1], twist[2]}, {twist[3], twist[4], twist[5]}};
}

/// Of a pose, from the tangent of the body to ROS's: translation along and turns about the fixed
/// axes of the frame that the pose is in. docs/frames.md.
[[nodiscard]] inline Matrix6d to_fixed_axes(const Matrix6d& covariance,
                                            const Eigen::Quaterniond& q) noexcept {
  Matrix6d R = Matrix6d::Zero();
  R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = q.toRotationMatrix();
  return R * covariance * R.transpose();
}

/// dds_write() reads what the sequence points to, nobody frees it.
template <class Sequence, class Item>
void lend(Sequence& sequence, Item* items, std::size_t count) noexcept {
  sequence._maximum = sequence._length = static_cast<std::uint32_t>(count);
  sequence._buffer = items;
  sequence._release = false;
}

}  // namespace maplet
