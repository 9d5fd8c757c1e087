// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/gpio/pulse_clock.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

void PulseClock::begin(Instant at) noexcept {
  first_ = at;
  count_ = 1;
  last_ = pulses_[0] = {};
  period_s_ = 1.0;
  start_s_ = jitter_s_ = 0.0;
  off_in_a_row_ = 0;
  ++taken_;
}

double PulseClock::gate_s(std::int64_t seconds) const noexcept {
  const double since = static_cast<double>(seconds);
  if (count_ < kEnough) return kGateS + kMaxDrift * since;
  // The slope is known as well as the jitter lets it be: far ahead the line is less sure.
  const double span = static_cast<double>(std::min<std::uint64_t>(count_, kWindow));
  return std::max(kGateS, 6.0 * jitter_s_) * (1.0 + since / span);
}

void PulseClock::pulse(Instant at) noexcept {
  if (count_ == 0) return begin(at);
  const double at_s = seconds(at - first_);
  const double last_s = start_s_ + period_s_ * static_cast<double>(last_.second);
  const auto ahead = static_cast<std::int64_t>(std::llround((at_s - last_s) / period_s_));
  const double expected_s = start_s_ + period_s_ * static_cast<double>(last_.second + ahead);
  if (ahead < 1 || std::abs(at_s - expected_s) > gate_s(ahead)) {
    ++glitches_;
    if (++off_in_a_row_ >= kRestartAfter) begin(at);
    return;
  }
  off_in_a_row_ = 0;
  missed_ += static_cast<std::uint64_t>(ahead - 1);
  last_ = {last_.second + ahead, at_s};
  pulses_[count_ % kWindow] = last_;
  ++count_;
  ++taken_;
  fit();
}

void PulseClock::fit() noexcept {
  const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(count_, kWindow));
  double mean_x = 0.0, mean_y = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    mean_x += static_cast<double>(pulses_[i].second);
    mean_y += pulses_[i].at_s;
  }
  mean_x /= static_cast<double>(n);
  mean_y /= static_cast<double>(n);
  double xx = 0.0, xy = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const double x = static_cast<double>(pulses_[i].second) - mean_x;
    xx += x * x;
    xy += x * (pulses_[i].at_s - mean_y);
  }
  period_s_ = std::clamp(xy / xx, 1.0 - kMaxDrift, 1.0 + kMaxDrift);
  start_s_ = mean_y - period_s_ * mean_x;
  double squares = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const double off =
        pulses_[i].at_s - start_s_ - period_s_ * static_cast<double>(pulses_[i].second);
    squares += off * off;
  }
  jitter_s_ = n > 2 ? std::sqrt(squares / static_cast<double>(n - 2)) : 0.0;
}

auto PulseClock::state(Instant now) const noexcept -> State {
  State state;
  state.pulses = taken_;
  state.glitches = glitches_;
  state.missed = missed_;
  if (count_ < kEnough) return state;
  const Instant last = first_ + Duration{std::llround(last_.at_s * 1e9)};
  state.locked = now - last < kLost;
  state.frequency_ppm = (period_s_ - 1.0) * 1e6;
  state.jitter_us = jitter_s_ * 1e6;
  const double on_line_s = start_s_ + period_s_ * static_cast<double>(last_.second);
  const double at_s = seconds(first_.time_since_epoch()) + on_line_s;
  state.phase_us = (at_s - std::floor(at_s)) * 1e6;
  return state;
}

}  // namespace maplet
