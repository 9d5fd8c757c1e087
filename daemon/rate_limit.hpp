// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "core/base/clock.hpp"

namespace maplet::daemon {

/// Lets so many a second through, evenly; what comes at just that rate passes whole, a little early
/// or late.
///
/// Memory   a value. Threads  one.
class RateLimit {
 public:
  /// @param hz  0: nothing passes
  explicit RateLimit(double hz) noexcept
      : period_{hz > 0.0 ? Duration{static_cast<Duration::rep>(1e9 / hz)} : Duration{}} {}

  [[nodiscard]] bool pass(Instant now) noexcept {
    if (period_ == Duration{} || (begun_ && now < due_ - period_ / 4)) return false;
    due_ = begun_ ? std::max(due_ + period_, now) : now + period_;
    begun_ = true;
    return true;
  }

 private:
  Duration period_;
  Instant due_{};
  bool begun_ = false;
};

}  // namespace maplet::daemon
