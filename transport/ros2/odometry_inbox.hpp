// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/geometry/se3.hpp"
#include "transport/dds/publisher.hpp"
#include "transport/ros2/ros2_config.hpp"

namespace maplet {

/// A nav_msgs/Odometry as somebody else wrote it, the names of its frames looked at and nothing
/// else: any number may be anything.
struct OdometryReport {
  std::int64_t stamp_ns = 0;
  std::uint64_t writer = 0;                     ///< who wrote it
  Eigen::Vector3d t = Eigen::Vector3d::Zero();  ///< of T_frame_base
  Eigen::Vector4d q{0.0, 0.0, 0.0, 1.0};        ///< x, y, z, w
  Matrix6d covariance = Matrix6d::Zero();       ///< as ROS has it: fixed axes
  Vector6d twist = Vector6d::Zero();            ///< base's axes
  Matrix6d twist_covariance = Matrix6d::Zero();
};

/// Reads external odometry from the local domain.
///
/// More than kMostPerSecond are thrown away unread, so a publisher that has gone mad costs what it
/// costs to receive it, and what it says between two bursts is still heard.
///
/// Memory   a queue of kQueue; Cyclone's own for one message.
/// Threads  join() by any, once; pop() by one caller, without waiting or allocation; Cyclone's
///   fills the queue.
class OdometryInbox final : public LocalGuest {
 public:
  static constexpr std::size_t kQueue = 256;
  static constexpr int kMostPerSecond = 1000;
  static constexpr int kMostAtOnce = 50;

  explicit OdometryInbox(const Ros2Config& config);
  ~OdometryInbox() override;
  OdometryInbox(const OdometryInbox&) = delete;
  OdometryInbox& operator=(const OdometryInbox&) = delete;

  [[nodiscard]] std::string join(std::int32_t participant) override;
  [[nodiscard]] bool pop(OdometryReport& report) noexcept;

  struct Counters {
    std::uint64_t received = 0;
    std::uint64_t wrong_frame = 0;  ///< frame_id or child_frame_id are not those wanted
    std::uint64_t flooded = 0;      ///< more than anybody needs
    std::uint32_t publishers = 0;
  };
  [[nodiscard]] Counters counters() const noexcept;  ///< any thread
  [[nodiscard]] static std::size_t bytes() noexcept { return kQueue * sizeof(OdometryReport); }

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace maplet
