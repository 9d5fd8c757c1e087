// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace maplet {

/// What is seen over what was to be expected, forgetting slowly.
class RunningRatio {
 public:
  /// @param frames  after which something is forgotten
  /// @param prior   as much was expected before the first frame, and `begin` times as much seen
  constexpr RunningRatio(double frames, double prior, double begin = 1.0) noexcept
      : keep_{1.0 - 1.0 / frames}, prior_{prior}, seen_{(begin - 1.0) * prior} {}

  /// Nothing expected is nothing learnt.
  void add(double seen, double expected) noexcept {
    if (expected <= 0.0) return;
    seen_ = keep_ * seen_ + seen;
    expected_ = keep_ * expected_ + expected;
  }
  [[nodiscard]] double value() const noexcept { return (prior_ + seen_) / (prior_ + expected_); }

 private:
  double keep_;
  double prior_;
  double seen_;
  double expected_ = 0.0;
};

}  // namespace maplet
