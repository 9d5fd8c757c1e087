// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/governor.hpp"

#include <algorithm>

namespace maplet::daemon {

namespace {

constexpr double kTake = 0.1;   // of the budget, for a late frame
constexpr double kGive = 0.02;  // back, for kEarlyFrames early ones
constexpr int kEarlyFrames = 10;
constexpr double kEarly = 0.8;      // of the budget
constexpr double kMemory = 0.1;     // weight of the newest frame in late_
constexpr double kTooMany = 0.3;    // late frames, then every second one is left out
constexpr int kPatientFrames = 60;  // early ones in a row, before frames come back

}  // namespace

bool Governor::skips() noexcept {
  phase_ = (phase_ + 1) % interval_;
  if (phase_ == 0) return false;
  ++skipped_;
  return true;
}

void Governor::done(Duration took, Duration whole) noexcept {
  const bool late = took > whole;
  const bool least = share_ <= kLeastShare;
  late_ += kMemory * ((late && least ? 1.0 : 0.0) - late_);
  if (late) {
    early_ = 0;
    share_ = std::max(kLeastShare, share_ - kTake);
    if (late_ > kTooMany && interval_ < kMostInterval) {
      ++interval_;
      late_ = 0.0;
    }
    return;
  }
  if (took > budget(whole) &&
      took > Duration{static_cast<Duration::rep>(kEarly * static_cast<double>(whole.count()))}) {
    early_ = 0;
    return;
  }
  ++early_;
  if (interval_ > 1) {
    if (early_ < kPatientFrames) return;
    --interval_;
    early_ = 0;
  } else if (early_ >= kEarlyFrames) {
    early_ = 0;
    share_ = std::min(1.0, share_ + kGive);
  }
}

}  // namespace maplet::daemon
