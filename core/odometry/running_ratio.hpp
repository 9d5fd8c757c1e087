// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace maplet {

/// What is seen over what was to be expected, forgetting slowly. Begins at 1.
class RunningRatio {
 public:
  constexpr RunningRatio(double frames, double prior) noexcept
      : keep_{1.0 - 1.0 / frames}, prior_{prior} {}

  void add(double seen, double expected) noexcept {
    seen_ = keep_ * seen_ + seen;
    expected_ = keep_ * expected_ + expected;
  }
  [[nodiscard]] double value() const noexcept { return (prior_ + seen_) / (prior_ + expected_); }

 private:
  double keep_;
  double prior_;  ///< as much as was expected before the first frame, and as much seen
  double seen_ = 0.0;
  double expected_ = 0.0;
};

}  // namespace maplet
