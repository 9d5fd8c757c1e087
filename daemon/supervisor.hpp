// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <thread>

#include "core/base/clock.hpp"
#include "daemon/heartbeat.hpp"
#include "daemon/log.hpp"
#include "daemon/status_board.hpp"

namespace maplet::daemon {

/// The housekeeping thread of the service: tells systemd's watchdog that the estimator gets on, and
/// how the daemon is in one line (systemctl status); writes the frame path's warnings; reads the
/// configuration anew on SIGHUP.
///
/// A thread of ours that stands still is not covered up: the watchdog gets nothing, and systemd
/// restarts the service. A camera that is not there is no such case.
///
/// Memory   allocates, beside the frame path. Threads  one of its own, which calls `reload`.
class Supervisor {
 public:
  /// @param reload  reads the configuration
  Supervisor(const Heartbeat& estimator, const StatusBoard& board, FewLines& warnings,
             std::function<void()> reload);
  ~Supervisor();
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

 private:
  void loop();

  Heartbeat::Look estimator_;
  const StatusBoard& board_;
  FewLines& warnings_;
  std::function<void()> reload_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace maplet::daemon
