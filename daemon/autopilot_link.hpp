// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "daemon/autopilot_address.hpp"
#include "daemon/autopilot_config.hpp"
#include "daemon/autopilot_record.hpp"
#include "daemon/pose_report.hpp"
#include "daemon/rate_limit.hpp"

namespace maplet::daemon {

/// Sends pose records to one place, as datagrams. Nobody being there, or not reading, costs a
/// record and nothing else: a send never waits, and the next one is tried all the same.
///
/// Memory   a value. Threads  send() by the estimator's, about 10 us each; status() by any.
class AutopilotLink {
 public:
  struct How {
    OutputFrame frame = OutputFrame::kEnuFlu;
    std::uint16_t agent = 0;
    bool system_clock = false;
  };
  /// @pre config.destination has been checked
  AutopilotLink(const AutopilotConfig& config, How how);
  ~AutopilotLink();
  AutopilotLink(const AutopilotLink&) = delete;
  AutopilotLink& operator=(const AutopilotLink&) = delete;

  void send(const PoseReport& report, Instant now) noexcept;

  struct Status {
    std::uint64_t sent = 0;
    std::uint64_t failed = 0;
    int error = 0;  ///< errno of the last send; 0: it went out
  };
  [[nodiscard]] Status status() const noexcept;

 private:
  [[nodiscard]] bool open(Instant now) noexcept;
  void note(int error) noexcept;

  How how_;
  DatagramAddress to_;
  RateLimit rate_;
  int socket_ = -1;
  Instant tried_{};
  std::uint32_t sequence_ = 0;
  std::atomic<std::uint64_t> sent_{0};
  std::atomic<std::uint64_t> failed_{0};
  std::atomic<int> error_{0};
};

}  // namespace maplet::daemon
