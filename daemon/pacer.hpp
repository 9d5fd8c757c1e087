// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

#include "core/base/clock.hpp"

namespace maplet::daemon {

/// Decides when a frame is processed, and which clock the stages see.
///
/// fast      as soon as it is read; the clock stands still inside a step and jumps by the frames'
///           stamps between, so no deadline ever cuts and the bytes are the same every time.
/// recorded  at its stamp, counted from the first frame; a frame that is more than one frame period
///           late is dropped, as a camera would have dropped it.
/// live      as soon as it comes, under the machine's clock.
///
/// Threads   one.
class Pacer {
 public:
  enum class Mode : std::uint8_t { kFast, kRecorded, kLive };

  explicit Pacer(Mode mode) noexcept : mode_{mode} {}

  [[nodiscard]] const Clock& clock() const noexcept {
    return mode_ == Mode::kFast ? static_cast<const Clock&>(manual_) : monotonic_;
  }
  /// Waits until the frame is due, or `stop` is set.
  /// @return false when it comes too late: drop it
  [[nodiscard]] bool wait(Stamp stamp, const std::atomic<bool>& stop) noexcept;

 private:
  Mode mode_;
  ManualClock manual_;
  MonotonicClock monotonic_;
  bool started_ = false;
  Stamp first_{};
  Stamp previous_{};
  Instant start_{};
};

}  // namespace maplet::daemon
