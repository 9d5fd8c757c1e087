// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

#include "core/base/clock.hpp"
#include "core/base/deadline.hpp"

namespace maplet::daemon {

/// Decides when a frame is processed, and which deadline a step has.
///
/// fast      as soon as it is read, without a deadline: limits in counts decide, and the bytes are
///           the same every time.
/// recorded  at its stamp, counted from the first frame; a frame that is more than one frame period
///           late is dropped, as a camera would have dropped it. A source that is slower than its
///           own stamps never catches up by dropping: then the frame at hand is the newest there
///           is, and time is counted from it anew.
/// live      as soon as it comes, under the machine's clock.
///
/// Threads   one.
class Pacer {
 public:
  enum class Mode : std::uint8_t { kFast, kRecorded, kLive };

  explicit Pacer(Mode mode) noexcept : mode_{mode} {}

  /// Of a step with this budget: in fast pace none at all.
  [[nodiscard]] Deadline deadline(Duration budget) const noexcept {
    return mode_ == Mode::kFast ? Deadline::never() : Deadline{monotonic_, budget};
  }
  /// Waits until the frame is due, or `stop` is set.
  /// @return false when it comes too late: drop it
  [[nodiscard]] bool wait(Stamp stamp, const std::atomic<bool>& stop) noexcept;

 private:
  Mode mode_;
  MonotonicClock monotonic_;
  bool started_ = false;
  Stamp first_{};
  Stamp previous_{};
  Instant start_{};
  std::int64_t to_drop_ = 0;  ///< frames that would make up for being late
};

}  // namespace maplet::daemon
