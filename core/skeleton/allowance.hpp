// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/base/deadline.hpp"

namespace maplet {

/// What an update may still spend: time, and work. Work is counted, so that a limit on it cuts at
/// the same place in every run; a unit is about 20 ns on a core of 3 GHz.
///
/// Time   spend O(1); it looks at the clock about every 50 us.
class Allowance {
 public:
  Allowance(Deadline deadline, std::int64_t work) noexcept : deadline_{deadline}, left_{work} {}
  [[nodiscard]] static Allowance unlimited() noexcept {
    return {Deadline::never(), std::int64_t{1} << 62};
  }

  /// Takes work off that was done. @return whether to stop here; once true, always true
  bool spend(std::int64_t work) noexcept {
    left_ -= work;
    unseen_ += work;
    if (stop_ || left_ < 0) return stop_ = true;
    if (unseen_ < kWorkPerLook) return false;
    unseen_ = 0;
    return stop_ = deadline_.expired();
  }
  /// Whether so much work may be done in one go.
  [[nodiscard]] bool fits(std::int64_t work) const noexcept {
    return work <= left_ && !stop_ && deadline_.remaining() > Duration{kNsPerWork * work};
  }
  [[nodiscard]] bool spent() const noexcept { return stop_; }

 private:
  static constexpr std::int64_t kWorkPerLook = 2500;
  static constexpr std::int64_t kNsPerWork = 20;

  Deadline deadline_;
  std::int64_t left_;
  std::int64_t unseen_ = 0;
  bool stop_ = false;
};

}  // namespace maplet
