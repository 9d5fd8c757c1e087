// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace maplet {

/// Which counters of a session were seen: each is taken once, in any order within the last 64
/// (RFC 4303, 3.4.3). Memory: inside.
class ReplayWindow {
 public:
  static constexpr std::uint32_t kWidth = 64;

  ReplayWindow() noexcept = default;
  /// Everything up to here is over.
  explicit ReplayWindow(std::uint32_t top) noexcept : top_{top}, seen_{~std::uint64_t{0}} {}

  [[nodiscard]] bool fresh(std::uint32_t counter) const noexcept {
    if (counter > top_) return true;
    const std::uint32_t back = top_ - counter;
    return back < kWidth && (seen_ >> back & 1) == 0;
  }
  void note(std::uint32_t counter) noexcept {
    if (counter > top_) {
      const std::uint32_t by = counter - top_;
      seen_ = by < kWidth ? seen_ << by : 0;
      top_ = counter;
    }
    if (top_ - counter < kWidth) seen_ |= std::uint64_t{1} << (top_ - counter);
  }

 private:
  std::uint32_t top_ = 0;
  std::uint64_t seen_ = 0;
};

}  // namespace maplet
