// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace maplet {

/// What competes for the link, by value per byte.
enum class Traffic : std::uint8_t { kDeltaPoses, kClosures, kRanges, kControl, kMaplets };
inline constexpr std::size_t kTraffics = 5;

/// Which kinds of traffic wait: a set.
class Waiting {
 public:
  void set(Traffic traffic) noexcept { bits_ |= 1U << static_cast<unsigned>(traffic); }
  [[nodiscard]] bool has(Traffic traffic) const noexcept {
    return (bits_ >> static_cast<unsigned>(traffic) & 1U) != 0;
  }
  [[nodiscard]] bool none() const noexcept { return bits_ == 0; }

 private:
  unsigned bits_ = 0;
};

/// Who goes next: fair queueing, weighted by value per byte. Where all wait, delta-poses get half
/// of the bytes and maplets a sixteenth; what one does not use, the others get. Nothing starves.
///
/// Memory fixed. Time O(kinds). Threads one.
class Scheduler {
 public:
  static constexpr std::array<double, kTraffics> kWeights = {16.0, 8.0, 2.0, 4.0, 2.0};

  /// @return the kind to serve, nothing when none waits
  [[nodiscard]] std::optional<Traffic> pick(const Waiting& waiting) noexcept {
    std::optional<Traffic> best;
    for (std::size_t i = 0; i < kTraffics; ++i) {
      if (!waiting.has(static_cast<Traffic>(i))) continue;
      time_[i] = std::max(time_[i], now_);  // nobody saves up while idle
      if (!best || time_[i] < time_[static_cast<std::size_t>(*best)])
        best = static_cast<Traffic>(i);
    }
    if (best) now_ = time_[static_cast<std::size_t>(*best)];
    return best;
  }
  void charge(Traffic traffic, std::size_t bytes) noexcept {
    const auto i = static_cast<std::size_t>(traffic);
    time_[i] = std::max(time_[i], now_) + static_cast<double>(bytes) / kWeights[i];
  }

 private:
  std::array<double, kTraffics> time_{};  ///< bytes over weight, up to which each was served
  double now_ = 0.0;
};

}  // namespace maplet
