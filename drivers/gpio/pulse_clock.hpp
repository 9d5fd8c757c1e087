// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/base/clock.hpp"

namespace maplet {

/// How fast this machine's monotonic clock goes, by a pulse a second (PPS).
///
/// A straight line through the last pulses: its slope is the length of a true second on our clock.
/// Edges off the line are glitches, left out and counted; missing ones are bridged. When every edge
/// is off for kRestartAfter in a row, it begins anew.
///
/// Memory   fixed. Threads  one caller at a time.
/// Math     least squares over kWindow pulses; an edge counts within max(kGate, 6 jitter).
class PulseClock {
 public:
  static constexpr std::size_t kWindow = 16;
  static constexpr std::uint64_t kEnough = 4;  ///< pulses until it is believed
  static constexpr int kRestartAfter = 5;
  static constexpr double kGateS = 1e-3;
  static constexpr double kMaxDrift = 500e-6;  ///< no quartz is worse
  static constexpr Duration kLost = std::chrono::milliseconds{3500};

  struct State {
    bool locked = false;         ///< enough pulses, the last one not long ago
    double frequency_ppm = 0.0;  ///< of our clock against the pulse: above 0 = ours is fast
    double jitter_us = 0.0;      ///< rms of the pulses about the line
    double phase_us = 0.0;       ///< of the pulse within our clock's second, 0 .. 1e6
    std::uint64_t pulses = 0;    ///< that counted
    std::uint64_t glitches = 0;  ///< edges that did not
    std::uint64_t missed = 0;    ///< pulses that did not come
  };

  /// An active edge.
  void pulse(Instant at) noexcept;
  [[nodiscard]] State state(Instant now) const noexcept;
  /// True seconds in a second of our clock; 1 until pulses are believed. Stays when they end.
  [[nodiscard]] double rate() const noexcept { return count_ < kEnough ? 1.0 : 1.0 / period_s_; }

 private:
  struct Pulse {
    std::int64_t second = 0;  ///< since the first
    double at_s = 0.0;        ///< since the first, on our clock
  };
  void begin(Instant at) noexcept;
  void fit() noexcept;
  [[nodiscard]] double gate_s(std::int64_t seconds) const noexcept;

  Instant first_{};
  std::array<Pulse, kWindow> pulses_{};
  std::uint64_t count_ = 0;  ///< since begin()
  Pulse last_;
  double period_s_ = 1.0;  ///< of the pulse on our clock
  double start_s_ = 0.0;   ///< of the line at second 0
  double jitter_s_ = 0.0;
  int off_in_a_row_ = 0;
  std::uint64_t taken_ = 0, glitches_ = 0, missed_ = 0;
};

}  // namespace maplet
