// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

#include "core/base/clock.hpp"
#include "core/base/deadline.hpp"

namespace maplet::daemon {

/// How a run keeps time.
///
/// fast      every frame, as soon as it is read, without a deadline: limits in counts decide, and
///           the bytes are the same every time.
/// recorded  a frame comes at its stamp, counted from the first one, as from the camera that it was
///           recorded with. A source that is slower than its own stamps is waited for: time is
///           counted from its frame anew.
/// live      as soon as it comes, under the machine's clock.
enum class Pace : std::uint8_t { kFast, kRecorded, kLive };

/// Holds the frames of a recording back until they are due.
///
/// Threads   one.
class Pacer {
 public:
  explicit Pacer(Pace pace) noexcept : pace_{pace} {}

  /// Waits until the frame is due, or `stop` is set.
  void wait(Stamp stamp, const std::atomic<bool>& stop) noexcept;

 private:
  Pace pace_;
  MonotonicClock monotonic_;
  bool started_ = false;
  Stamp first_{};
  Instant start_{};
};

}  // namespace maplet::daemon
