// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/pacer.hpp"

#include <algorithm>
#include <thread>

namespace maplet::daemon {

void Pacer::wait(Stamp stamp, const std::atomic<bool>& stop) noexcept {
  if (pace_ != Pace::kRecorded) return;
  const Instant now = monotonic_.now();
  if (!started_) {
    started_ = true;
    first_ = stamp;
    start_ = now;
  }
  const Instant due = start_ + (stamp - first_);
  if (now > due) start_ += now - due;
  constexpr Duration kLook = std::chrono::milliseconds{50};  // how often a stop is noticed
  while (!stop && monotonic_.now() < due) {
    std::this_thread::sleep_for(std::min<Duration>(kLook, due - monotonic_.now()));
  }
}

}  // namespace maplet::daemon
