// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>

namespace maplet {

using Duration = std::chrono::nanoseconds;

/// A recording's or sensor's time: nanoseconds since that source's own epoch. Never compared with
/// Instant.
using Stamp = std::chrono::nanoseconds;

/// A point on an injected Clock.
struct ClockTag {
  using duration = Duration;
  using rep = Duration::rep;
  using period = Duration::period;
  using time_point = std::chrono::time_point<ClockTag>;
  static constexpr bool is_steady = true;
};
using Instant = ClockTag::time_point;

/// Time is injected: stages see only this.
class Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual Instant now() const noexcept = 0;
};

/// The machine's monotonic clock. Threads: any.
class MonotonicClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const noexcept override {
    return Instant{
        std::chrono::duration_cast<Duration>(std::chrono::steady_clock::now().time_since_epoch())};
  }
};

/// A clock that stands still until somebody moves it: `--pace fast` drives it with frame stamps.
class ManualClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const noexcept override { return now_; }
  void set(Instant now) noexcept { now_ = now; }
  void advance(Duration by) noexcept { now_ += by; }

 private:
  Instant now_{};
};

[[nodiscard]] constexpr double seconds(Duration duration) noexcept {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace maplet
