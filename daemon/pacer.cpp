// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/pacer.hpp"

#include <algorithm>
#include <thread>

namespace maplet::daemon {

bool Pacer::wait(Stamp stamp, const std::atomic<bool>& stop) noexcept {
  const Instant now = monotonic_.now();
  if (!started_) {
    started_ = true;
    first_ = previous_ = stamp;
    start_ = now;
  }
  const Duration period = stamp - previous_;
  previous_ = stamp;
  if (mode_ != Mode::kRecorded) return true;

  const Instant due = start_ + (stamp - first_);
  constexpr Duration kLook = std::chrono::milliseconds{50};  // how often a stop is noticed
  while (!stop && monotonic_.now() < due) {
    std::this_thread::sleep_for(std::min<Duration>(kLook, due - monotonic_.now()));
  }
  if (now <= due + period || period == Duration{0}) {
    to_drop_ = 0;
    return true;
  }
  if (to_drop_ == 0) {
    to_drop_ = (now - due) / std::max(period, Duration{1}) + 1;
  }
  if (--to_drop_ > 0) return false;
  start_ = now - (stamp - first_);
  return true;
}

}  // namespace maplet::daemon
