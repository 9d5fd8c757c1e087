// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "core/agent/agent.hpp"
#include "daemon/autopilot_link.hpp"
#include "daemon/config.hpp"
#include "daemon/external_odometry.hpp"
#include "daemon/pacer.hpp"
#include "daemon/pose_report.hpp"
#include "daemon/ros2_link.hpp"
#include "drivers/paired_source.hpp"

namespace maplet::daemon {

/// The other programs on this robot: ROS 2 nodes and an autopilot's bridge are told where it is,
/// and somebody else's odometry comes in as a prior of the motion.
///
/// Memory   fixed at construction: neighbours_bytes().
/// Threads  the estimator's; status() by any. Nothing here waits for anybody.
class Neighbours final : public LocalGuest {
 public:
  /// @return whether the configuration asks for any. @param dds  without it there is no ROS
  [[nodiscard]] static bool needed(const Config& config, bool dds) noexcept;

  Neighbours(const Config& config, int agent, Pace pace, bool dds, const StatusBoard& board);

  [[nodiscard]] std::string join(std::int32_t participant) override;
  void start();

  /// A frame came: its time in the clock outside, and what others say of the motion until it.
  /// @param came  when it was here
  void came(DepthFrame& frame, Instant came) noexcept;
  /// It was worked at.
  void tell(const Step& step, Agent& agent) noexcept;
  /// Between frames: others' maplets may have come.
  void look(Agent& agent) noexcept {
    if (ros_) ros_->map().look(agent);
  }
  /// The run is over: the whole map and path go out.
  void finish(Agent& agent, Duration limit) noexcept;

  struct Status {
    bool system_clock = false;
    std::optional<Ros2Link::Status> ros;
    std::optional<AutopilotLink::Status> autopilot;
    struct External {
      OdometryInbox::Counters inbox;
      ExternalOdometry::Counters counted;
    };
    std::optional<External> external;
  };
  [[nodiscard]] Status status() const noexcept;

 private:
  const Config& config_;
  bool system_clock_;
  PoseReporter reporter_;
  std::unique_ptr<Ros2Link> ros_;
  std::unique_ptr<AutopilotLink> autopilot_;
  std::unique_ptr<OdometryInbox> inbox_;
  std::unique_ptr<ExternalOdometry> external_;
  StampClock source_clock_;
  MonotonicClock monotonic_;
  Instant came_{};
  std::int64_t stamp_ns_ = 0;  ///< of the newest frame
};

/// What they take of memory, beside the arena. @param dds  without it there is no ROS
[[nodiscard]] std::size_t neighbours_bytes(const Config& config, bool dds);

}  // namespace maplet::daemon
