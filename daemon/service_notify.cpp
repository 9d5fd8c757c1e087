// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/service_notify.hpp"

#include <fmt/format.h>
#include <systemd/sd-daemon.h>

#include <array>
#include <chrono>
#include <cstdint>

namespace maplet::daemon {

void notify_ready() noexcept { sd_notify(0, "READY=1"); }
void notify_stopping() noexcept { sd_notify(0, "STOPPING=1"); }
void notify_watchdog() noexcept { sd_notify(0, "WATCHDOG=1"); }

void notify_reloading() noexcept {
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(
      MonotonicClock{}.now().time_since_epoch());
  sd_notifyf(0, "RELOADING=1\nMONOTONIC_USEC=%lld", static_cast<long long>(us.count()));
}

void notify_status(const char* status) noexcept {
  std::array<char, 256> line{};
  fmt::format_to_n(line.data(), line.size() - 1, "STATUS={}", status);
  sd_notify(0, line.data());
}

Duration watchdog_patience() noexcept {
  std::uint64_t us = 0;
  if (sd_watchdog_enabled(0, &us) <= 0) return {};
  return std::chrono::microseconds{us};
}

std::string service_line(const StatusRecord& s) {
  switch (s.state) {
    case StatusRecord::State::kStarting:
      return "starting";
    case StatusRecord::State::kWaitingForCamera:
      return "waiting for a camera";
    case StatusRecord::State::kStopping:
      return "stopping";
    case StatusRecord::State::kHeld:
      return fmt::format("held by a switch, {} maplets", s.maplets);
    case StatusRecord::State::kWaitingForInterface:
    case StatusRecord::State::kRunning:
    case StatusRecord::State::kDegraded:
      break;
  }
  return fmt::format("{}{}, {} frames, {} dropped, {} maplets, {} closures",
                     s.tracking ? "tracking" : "not tracking",
                     s.state == StatusRecord::State::kDegraded ? " (degraded)" : "",
                     s.frames_processed, s.frames_dropped, s.maplets, s.closures);
}

}  // namespace maplet::daemon
