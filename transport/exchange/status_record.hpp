// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/clock.hpp"
#include "core/ports/stage_meter.hpp"

namespace maplet {

/// A stage's time since READY; CPU time of its thread.
struct StageTime {
  std::uint32_t p50_us = 0;
  std::uint32_t p99_us = 0;
  std::uint32_t max_us = 0;
  std::uint32_t deadline_misses = 0;

  friend bool operator==(const StageTime&, const StageTime&) = default;
};

/// How an agent is: published about once a second.
struct StatusRecord {
  enum class State : std::uint8_t {
    kStarting,
    kRunning,
    kWaitingForCamera,
    kWaitingForInterface,
    kDegraded,  ///< running, with less quality to keep the budget
    kStopping,
    kHeld,  ///< by a switch: no frame is worked at
  };

  std::uint16_t agent = 0;
  std::uint32_t epoch = 0;
  State state = State::kStarting;
  bool tracking = false;
  Stamp stamp{};  ///< of the newest frame
  std::uint64_t uptime_ms = 0;
  std::uint64_t frames_read = 0;
  std::uint64_t frames_processed = 0;
  std::uint64_t frames_dropped = 0;
  std::uint64_t frames_lost = 0;  ///< processed, but not tracked
  std::uint32_t keyframes = 0;
  std::uint32_t maplets = 0;
  std::uint32_t delta_poses = 0;
  std::uint32_t closures = 0;
  std::uint32_t nodes = 0;             ///< of the skeleton
  std::uint32_t factors = 0;           ///< of the skeleton
  std::uint32_t messages_dropped = 0;  ///< the publisher's queues were full
  std::uint64_t arena_bytes = 0;
  std::uint64_t rss_bytes = 0;
  std::array<StageTime, kStages> stages{};  ///< by Stage

  friend bool operator==(const StatusRecord&, const StatusRecord&) = default;
};

[[nodiscard]] constexpr std::string_view to_string(StatusRecord::State state) noexcept {
  switch (state) {
    case StatusRecord::State::kStarting:
      return "starting";
    case StatusRecord::State::kRunning:
      return "running";
    case StatusRecord::State::kWaitingForCamera:
      return "waiting_for_camera";
    case StatusRecord::State::kWaitingForInterface:
      return "waiting_for_interface";
    case StatusRecord::State::kDegraded:
      return "degraded";
    case StatusRecord::State::kStopping:
      return "stopping";
    case StatusRecord::State::kHeld:
      return "held";
  }
  return "?";
}

}  // namespace maplet
