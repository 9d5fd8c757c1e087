// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

namespace maplet {

/// How far stamps stray from an even beat, running over some thirty frames: where they come
/// unevenly, nobody knows whether the camera or the clock did.
class StampJitter {
 public:
  void add(double dt_s) noexcept {
    if (mean_s_ == 0.0) mean_s_ = dt_s;
    const double off = dt_s - mean_s_;
    mean_s_ += kFollow * off;
    variance_s2_ += kFollow * (off * off - variance_s2_);
  }
  /// One sigma of the time between two frames, s.
  [[nodiscard]] double sigma_s() const noexcept { return std::sqrt(variance_s2_); }

 private:
  static constexpr double kFollow = 1.0 / 30.0;

  double mean_s_ = 0.0;
  double variance_s2_ = 0.0;
};

}  // namespace maplet
