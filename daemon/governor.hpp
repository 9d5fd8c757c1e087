// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/base/clock.hpp"

namespace maplet::daemon {

/// Keeps frames inside their budget.
///
/// Stages stop at their deadlines, but overrun by a step, and the machine takes its share: so the
/// governor gives them less than the budget as soon as a frame was late, and gives it back while
/// frames are early. What a smaller budget cuts, and in which order, are the stages' own deadlines
/// (docs/service.md): patches, iterations, skeleton work. When the least budget is not
/// enough, frames are left out: every second one, every third.
///
/// Memory   fixed. Time O(1). Threads one.
class Governor {
 public:
  static constexpr double kLeastShare = 0.5;  ///< of the budget that the stages always get
  static constexpr int kMostInterval = 4;     ///< one frame of so many

  /// What the stages share of the next frame.
  [[nodiscard]] Duration budget(Duration whole) const noexcept {
    return Duration{static_cast<Duration::rep>(static_cast<double>(whole.count()) * share_)};
  }
  /// Whether this frame is to be left out.
  [[nodiscard]] bool skips() noexcept;
  /// A frame took that long.
  void done(Duration took, Duration whole) noexcept;

  [[nodiscard]] bool degraded() const noexcept { return share_ < 1.0 || interval_ > 1; }
  [[nodiscard]] std::uint64_t skipped() const noexcept { return skipped_; }

 private:
  double share_ = 1.0;
  int interval_ = 1;
  int phase_ = 0;
  int early_ = 0;    ///< frames in a row well inside the budget
  double late_ = 0;  ///< share of late frames at the least budget, over about the last ten
  std::uint64_t skipped_ = 0;
};

}  // namespace maplet::daemon
