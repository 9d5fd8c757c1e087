// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/supervisor.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

#include "daemon/service_notify.hpp"
#include "daemon/signals.hpp"
#include "daemon/thread_setup.hpp"

namespace maplet::daemon {

namespace {

using namespace std::chrono_literals;

constexpr Duration kLook = 50ms;  // at signals and the end

}  // namespace

Supervisor::Supervisor(const Heartbeat& estimator, const StatusBoard& board, FewLines& warnings,
                       std::function<void()> reload)
    : estimator_{estimator}, board_{board}, warnings_{warnings}, reload_{std::move(reload)} {
  thread_ = start_thread("housekeeping", [this] { loop(); });
}

Supervisor::~Supervisor() {
  stop_ = true;
  thread_.join();
}

void Supervisor::loop() {
  const MonotonicClock clock;
  // A quarter of the watchdog's patience: a beat that is late by one look does no harm.
  const Duration patience = watchdog_patience();
  const Duration period = patience > 0ns ? patience / 4 : 1s;
  Instant next_feed = clock.now();
  Instant next_line = clock.now() + 1s;
  std::string said;
  while (!stop_) {
    const Instant now = clock.now();
    if (patience > 0ns && now >= next_feed) {
      next_feed = now + period;
      if (estimator_.moved_on()) notify_watchdog();
    }
    if (now >= next_line) {
      next_line = now + 1s;
      const std::string line = service_line(board_.read().status);
      if (line != said) notify_status(line.c_str());
      said = line;
    }
    warnings_.flush();
    if (take_reload()) {
      notify_reloading();
      reload_();
      notify_ready();
    }
    std::this_thread::sleep_for(std::min(kLook, period));
  }
  warnings_.flush();
}

}  // namespace maplet::daemon
