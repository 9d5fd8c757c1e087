// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/neighbours.hpp"

#include <ctime>

#include "daemon/pose_text.hpp"

namespace maplet::daemon {

namespace {

/// From the monotonic clock to the system's, now.
Duration system_ahead(Instant now) noexcept {
  timespec time{};
  clock_gettime(CLOCK_REALTIME, &time);
  return std::chrono::seconds{time.tv_sec} + Duration{time.tv_nsec} - now.time_since_epoch();
}

bool uses_system_clock(const Config& config, Pace pace) noexcept {
  if (config.ros2.clock == "auto") return pace == Pace::kLive;
  return config.ros2.clock == "system";
}

std::size_t maplets_of(const Config& config) noexcept {
  return static_cast<std::size_t>(config.agent.skeleton.max_nodes);
}

}  // namespace

bool Neighbours::needed(const Config& config, bool dds) noexcept {
  return config.autopilot.used() || (dds && config.ros2.used());
}

Neighbours::Neighbours(const Config& config, int agent, Pace pace, bool dds,
                       const StatusBoard& board)
    : config_{config},
      system_clock_{uses_system_clock(config, pace)},
      reporter_{pose_of(config.body.T_body_camera).value_or(Se3{}), config.body.up} {
  if (config.autopilot.used()) {
    autopilot_ = std::make_unique<AutopilotLink>(
        config.autopilot, AutopilotLink::How{output_frame_of(config.mission.output_frame),
                                             static_cast<std::uint16_t>(agent), system_clock_});
  }
  if (!dds) return;
  if (config.ros2.enabled)
    ros_ = std::make_unique<Ros2Link>(config.ros2, agent, maplets_of(config), board);
  if (!config.ros2.external_odometry.empty()) {
    inbox_ = std::make_unique<OdometryInbox>(config.ros2);
    external_ = std::make_unique<ExternalOdometry>(config.agent.odometry,
                                                   reporter_.frames().T_body_camera());
  }
}

std::string Neighbours::join(std::int32_t participant) {
  std::string problem;
  if (ros_) problem = ros_->topics().join(participant);
  if (inbox_ && problem.empty()) problem = inbox_->join(participant);
  return problem;
}

void Neighbours::start() {
  if (ros_) ros_->start();
}

void Neighbours::came(DepthFrame& frame, Instant came) noexcept {
  came_ = came;
  Stamp stamp = frame.stamp;
  if (system_clock_) {
    const Instant at = source_clock_.at(frame.stamp, came);
    stamp = at.time_since_epoch() + system_ahead(monotonic_.now());
  }
  stamp_ns_ = stamp.count();
  if (!external_) return;
  OdometryReport report;
  constexpr int kAtOnce = 64;
  for (int i = 0; i < kAtOnce && inbox_->pop(report); ++i) external_->take(report, stamp);
  if (frame.motion.has_pose) return;  // the recording has its own
  const MotionHint hint = external_->at(stamp);
  frame.motion.has_pose = hint.has_pose;
  frame.motion.T_external_camera = hint.T_external_camera;
  frame.motion.path_covariance = hint.path_covariance;
}

void Neighbours::tell(const Step& step, Agent& agent) noexcept {
  PoseReport report = reporter_.report(step, agent);
  report.stamp_ns = stamp_ns_;
  report.came = came_;
  if (external_ && report.tracking) external_->tracked();
  if (autopilot_) autopilot_->send(report, monotonic_.now());
  if (!ros_) return;
  ros_->report(report);
  look(agent);
}

void Neighbours::finish(Agent& agent, Duration limit) noexcept {
  if (!ros_) return;
  // Poses of all, and one that is new each time.
  const int rounds = 1 + agent.skeleton().node_count() / MapView::kAtOnce;
  for (int i = 0; i < 2 * rounds + agent.skeleton().node_count(); ++i) look(agent);
  ros_->finish(limit);
}

Neighbours::Status Neighbours::status() const noexcept {
  Status out;
  out.system_clock = system_clock_;
  if (ros_) out.ros = ros_->status();
  if (autopilot_) out.autopilot = autopilot_->status();
  if (external_) out.external = Status::External{inbox_->counters(), external_->counters()};
  return out;
}

std::size_t neighbours_bytes(const Config& config, bool dds) {
  std::size_t bytes = sizeof(Neighbours) + sizeof(AutopilotLink);
  if (dds && config.ros2.enabled) bytes += Ros2Link::bytes(config.ros2, maplets_of(config));
  if (dds && !config.ros2.external_odometry.empty())
    bytes += OdometryInbox::bytes() + sizeof(ExternalOdometry);
  return bytes;
}

}  // namespace maplet::daemon
