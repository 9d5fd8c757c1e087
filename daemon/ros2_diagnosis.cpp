// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/ros2_diagnosis.hpp"

#include <fmt/format.h>

#include <utility>

namespace maplet::daemon {

namespace {

using Level = RosDiagnosis::Level;
using State = StatusRecord::State;

std::pair<Level, std::string> verdict(const StatusBoard::Notice& n, bool silent) {
  const StatusRecord& s = n.status;
  if (silent) return {Level::kError, "the estimator says nothing"};
  switch (s.state) {
    case State::kStarting:
      return {Level::kWarn, "starting"};
    case State::kWaitingForCamera:
      return {Level::kError, "waiting for a camera"};
    case State::kWaitingForInterface:
      return {Level::kError, "waiting for the interface"};
    case State::kHeld:
      return {Level::kWarn, "held by a switch"};
    case State::kStopping:
      return {Level::kWarn, "stopping"};
    case State::kRunning:
    case State::kDegraded:
      break;
  }
  if (!s.tracking) return {Level::kError, "lost"};
  if (n.free.sigma_m > 0.0 || n.free.sigma_rad > 0.0)
    return {Level::kWarn, "tracking; nothing is seen along some direction"};
  if (s.state == State::kDegraded) return {Level::kWarn, "tracking; short of time"};
  return {Level::kOk, "tracking"};
}

}  // namespace

Diagnosis diagnose(const StatusBoard::Notice& n, int agent, bool silent) {
  const StatusRecord& s = n.status;
  Diagnosis out;
  auto [level, message] = verdict(n, silent);
  out.told.level = level;
  out.told.message = std::move(message);
  out.told.name = fmt::format("mapletd: agent {}", agent);
  out.told.hardware = fmt::format("mapletd-{}", agent);
  const auto add = [&](std::string_view key, const auto& value) {
    out.values.push_back({key, fmt::format("{}", value)});
  };
  add("state", to_string(s.state));
  add("tracking", s.tracking);
  add("frames_processed", s.frames_processed);
  add("frames_dropped", s.frames_dropped);
  add("frames_lost", s.frames_lost);
  add("maplets", s.maplets);
  add("delta_poses", s.delta_poses);
  add("closures", s.closures);
  add("map_jumps", n.frame.jumps);
  add("free_sigma_m", n.free.sigma_m);
  add("free_turn_sigma_rad", n.free.sigma_rad);
  add("hints_used", n.tracking.hints_used);
  add("hints_refused", n.tracking.hints_refused);
  add("frame_p99_us", s.stages[static_cast<std::size_t>(Stage::kFrame)].p99_us);
  return out;
}

}  // namespace maplet::daemon
