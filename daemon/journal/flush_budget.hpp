// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>

#include "core/base/clock.hpp"

namespace maplet::journal {

/// When a turn may be written: as soon as the bytes that the disk writes for it, whole pages, are
/// within 1.15 times what was recorded and 14 KiB a minute. The rest up to 1.3 times and 16 KiB is
/// left for changes of halves.
///
/// Memory   fixed. Time O(1). Threads one.
/// Math     docs/journal.md, section "What is written".
class FlushBudget {
 public:
  static constexpr double kPerByte = 1.15;
  static constexpr double kPerSecond = 14.0 * 1024.0 / 60.0;
  static constexpr double kMost = 14.0 * 1024.0;  ///< saved up while nothing happens

  explicit FlushBudget(Instant now) noexcept : at_{now} {}

  void recorded(std::size_t bytes) noexcept { earned_ += kPerByte * static_cast<double>(bytes); }
  [[nodiscard]] bool allows(std::size_t bytes, Instant now) noexcept {
    saved_ = std::min(kMost, saved_ + kPerSecond * seconds(now - at_));
    at_ = now;
    return saved_ + earned_ >= static_cast<double>(bytes);
  }
  void wrote(std::size_t bytes) noexcept {
    saved_ = std::min(kMost, saved_ + earned_ - static_cast<double>(bytes));
    earned_ = 0.0;
  }

 private:
  double saved_ = kMost;
  double earned_ = 0.0;
  Instant at_;
};

}  // namespace maplet::journal
