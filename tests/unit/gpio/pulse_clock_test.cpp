// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/gpio/pulse_clock.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace maplet {
namespace {

/// The true second `s` on a clock that is `ppm` fast.
Instant at(double s, double ppm = 0.0) {
  return Instant{std::chrono::hours{9}} + Duration{std::llround(s * (1.0 + ppm * 1e-6) * 1e9)};
}

TEST(PulseClock, KnowsNothingAtFirst) {
  PulseClock clock;
  EXPECT_FALSE(clock.state(at(0)).locked);
  for (int s = 0; s < 3; ++s) clock.pulse(at(s, 100.0));
  EXPECT_FALSE(clock.state(at(2)).locked);
  EXPECT_EQ(clock.rate(), 1.0);
}

TEST(PulseClock, FindsTheRate) {
  for (const double ppm : {-300.0, -20.0, 0.0, 35.0, 450.0}) {
    PulseClock clock;
    for (int s = 0; s < 40; ++s) clock.pulse(at(s, ppm));
    const auto state = clock.state(at(39, ppm));
    EXPECT_TRUE(state.locked);
    EXPECT_NEAR(state.frequency_ppm, ppm, 1e-3);
    EXPECT_NEAR(clock.rate(), 1.0 - ppm * 1e-6, 1e-6);
    EXPECT_LT(state.jitter_us, 0.01);
    EXPECT_EQ(state.glitches, 0u);
  }
}

// The slope of 16 points with sigma: sigma / sqrt(sum of (x - mean)^2) = sigma / 18.4 s.
TEST(PulseClock, AveragesJitter) {
  std::mt19937 random{3};
  std::normal_distribution<double> jitter_s{0.0, 50e-6};
  double squares = 0.0;
  constexpr int kRuns = 200;
  for (int run = 0; run < kRuns; ++run) {
    PulseClock clock;
    for (int s = 0; s < 30; ++s) clock.pulse(at(s + jitter_s(random), 10.0));
    const auto state = clock.state(at(29));
    ASSERT_TRUE(state.locked);
    squares += std::pow(state.frequency_ppm - 10.0, 2);
    EXPECT_GT(state.jitter_us, 20.0);
    EXPECT_LT(state.jitter_us, 90.0);
  }
  EXPECT_NEAR(std::sqrt(squares / kRuns), 50.0 / 18.4, 0.5);
}

TEST(PulseClock, LeavesGlitchesOutAndBridgesGaps) {
  PulseClock clock;
  for (int s = 0; s < 60; ++s) {
    if (s >= 20 && s < 23) continue;
    clock.pulse(at(s, 25.0));
    if (s % 10 == 5) clock.pulse(at(s + 0.31));
  }
  const auto state = clock.state(at(59));
  EXPECT_TRUE(state.locked);
  EXPECT_NEAR(state.frequency_ppm, 25.0, 1e-3);
  EXPECT_EQ(state.glitches, 6u);
  EXPECT_EQ(state.missed, 3u);
  EXPECT_EQ(state.pulses, 57u);
}

TEST(PulseClock, BeginsAnewWhenThePulsesMove) {
  PulseClock clock;
  for (int s = 0; s < 20; ++s) clock.pulse(at(s));
  for (int s = 20; s < 50; ++s) clock.pulse(at(s + 0.4));
  const auto state = clock.state(at(49.4));
  EXPECT_TRUE(state.locked);
  EXPECT_EQ(state.glitches, static_cast<std::uint64_t>(PulseClock::kRestartAfter));
  EXPECT_NEAR(state.phase_us, 4e5, 1.0);
}

TEST(PulseClock, IsLostWhenNoPulseComes) {
  PulseClock clock;
  for (int s = 0; s < 20; ++s) clock.pulse(at(s, 60.0));
  EXPECT_TRUE(clock.state(at(21)).locked);
  EXPECT_FALSE(clock.state(at(30)).locked);
  EXPECT_NEAR(clock.rate(), 1.0 - 60e-6, 1e-7);  // the best that is known
}

TEST(PulseClock, NeverBelievesSomethingElseThanSeconds) {
  PulseClock clock;
  for (int i = 0; i < 200; ++i) clock.pulse(at(0.3 * i));
  EXPECT_FALSE(clock.state(at(60)).locked);
}

}  // namespace
}  // namespace maplet
