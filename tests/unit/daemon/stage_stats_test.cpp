// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/stage_stats.hpp"

#include <gtest/gtest.h>

namespace maplet::daemon {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

TEST(DurationHistogram, PercentilesAreRightToOnePercent) {
  DurationHistogram histogram;
  for (int us = 1; us <= 1000; ++us) histogram.add(microseconds{us});
  EXPECT_NEAR(static_cast<double>(histogram.percentile(0.5).count()), 500e3, 6e3);
  EXPECT_NEAR(static_cast<double>(histogram.percentile(0.99).count()), 990e3, 11e3);
  EXPECT_EQ(histogram.max(), milliseconds{1});
  EXPECT_EQ(histogram.percentile(1.0), milliseconds{1});
}

TEST(DurationHistogram, IsToldInFewWords) {
  DurationHistogram histogram;
  for (const int us : {1, 40, 60, 4000, 4900, 60'000, 99'000, 200'000, 9'000'000}) {
    histogram.add(microseconds{us});
  }
  const ToldHistogram told = histogram.told();
  const std::array<std::uint64_t, 12> expected{2, 1, 0, 0, 0, 0, 2, 0, 0, 0, 2, 2};
  EXPECT_EQ(told.counts, expected);
  EXPECT_EQ(told.total, microseconds{1 + 40 + 60 + 4000 + 4900 + 60'000 + 99'000 + 9'200'000});
}

TEST(DurationHistogram, SurvivesExtremes) {
  DurationHistogram histogram;
  EXPECT_EQ(histogram.percentile(0.5), Duration{0});
  histogram.add(Duration{-5});
  histogram.add(Duration{0});
  histogram.add(std::chrono::hours{24 * 365});
  EXPECT_EQ(histogram.count(), 3u);
  EXPECT_LE(histogram.percentile(0.5), microseconds{1});
  EXPECT_EQ(histogram.max(), std::chrono::hours{24 * 365});
}

TEST(StageMeters, CountsWhatRanLongerThanItsBudget) {
  StageMeters meters;
  { const StageScope scope{meters, Stage::kPatches, Duration{0}}; }
  { const StageScope scope{meters, Stage::kPatches, std::chrono::hours{1}}; }
  EXPECT_EQ(meters.of(Stage::kPatches).wall.count(), 2u);
  EXPECT_EQ(meters.of(Stage::kPatches).deadline_misses, 1u);
  EXPECT_EQ(meters.of(Stage::kOdometry).wall.count(), 0u);
}

}  // namespace
}  // namespace maplet::daemon
