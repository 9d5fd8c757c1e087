// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/range_keeper.hpp"

#include <gtest/gtest.h>

namespace maplet {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr MapletKey kOurs{1, 10, 4};

DeltaPose step(std::uint32_t from, Stamp at, double x_m) {
  DeltaPose d;
  d.a = {2, 20, from};
  d.b = {2, 20, from + 1};
  d.stamp_a = at;
  d.stamp_b = at + seconds{10};
  d.T_a_b.se3.t.x() = x_m;
  d.covariance = 1e-4 * Matrix6d::Identity();
  return d;
}

PathPoint at_origin() {
  PathPoint point;
  point.maplet = kOurs;
  return point;
}

class Ranges : public testing::Test {
 protected:
  Ranges() {
    for (std::uint32_t i = 0; i < 3; ++i) {
      EXPECT_EQ(skeleton_.add(step(i, Stamp{seconds{100 + 10 * i}}, 2.0), Deadline::never()),
                Added::kLinked);
    }
  }
  void measure(Stamp stamp, Duration clock_offset = {}) {
    keeper_.note({2, stamp, {5.0, 0.1}, clock_offset});
  }

  Arena arena_;
  Skeleton skeleton_{SkeletonConfig{}, arena_};
  RangeKeeper keeper_;
};

TEST_F(Ranges, BetweenTwoOriginsNothingIsLost) {
  measure(Stamp{seconds{110}});
  EXPECT_FALSE(keeper_.place(skeleton_));  // our end is not known yet
  keeper_.at_frame(Stamp{seconds{110}}, at_origin());
  const auto range = keeper_.place(skeleton_);
  ASSERT_TRUE(range);
  EXPECT_EQ(range->a, kOurs);
  EXPECT_EQ(range->b, (MapletKey{2, 20, 1}));
  EXPECT_NEAR(range->range_m, 5.0, 1e-6);
  EXPECT_NEAR(range->sigma_m, 0.1, 1e-6);
  EXPECT_TRUE(keeper_.empty());
}

TEST_F(Ranges, TheOthersClockIsSetOffAndItsWayCounts) {
  const Duration hours = std::chrono::hours{-3};
  measure(Stamp{seconds{112}} - hours, hours);  // the other's clock says 112: a fifth of the way
  keeper_.at_frame(Stamp{seconds{112}} - hours + milliseconds{33}, at_origin());
  const auto range = keeper_.place(skeleton_);
  ASSERT_TRUE(range);
  EXPECT_EQ(range->b, (MapletKey{2, 20, 1}));
  EXPECT_GT(range->sigma_m, 0.4 / std::sqrt(3.0));  // 0.4 m in a direction that nobody knows
  EXPECT_LT(range->sigma_m, 1.0);
}

TEST_F(Ranges, WaitsForTheOthersPathAndThenGivesUp) {
  measure(Stamp{seconds{150}});
  keeper_.at_frame(Stamp{seconds{150}}, at_origin());
  EXPECT_FALSE(keeper_.place(skeleton_));
  ASSERT_FALSE(keeper_.empty());
  (void)skeleton_.add(step(3, Stamp{seconds{145}}, 1.0), Deadline::never());
  EXPECT_TRUE(keeper_.place(skeleton_));
  measure(Stamp{seconds{500}});
  keeper_.at_frame(Stamp{seconds{500}}, at_origin());
  EXPECT_FALSE(keeper_.place(skeleton_));
  keeper_.at_frame(Stamp{seconds{500}} + RangeKeeper::kPatience + seconds{1}, at_origin());
  EXPECT_FALSE(keeper_.place(skeleton_));
  EXPECT_TRUE(keeper_.empty());
  EXPECT_EQ(keeper_.counters().dropped, 1U);
}

TEST_F(Ranges, LostForLongOrTooManyIsCounted) {
  measure(Stamp{seconds{110}});
  keeper_.at_frame(Stamp{seconds{111}}, {});
  EXPECT_FALSE(keeper_.empty());
  keeper_.at_frame(Stamp{seconds{113}}, at_origin());
  EXPECT_TRUE(keeper_.empty());
  for (std::size_t i = 0; i < RangeKeeper::kWaiting + 3; ++i) measure(Stamp{seconds{120}});
  EXPECT_EQ(keeper_.counters().dropped, 4U);
}

TEST_F(Ranges, AnUnknownAgentHasNoPath) {
  EXPECT_FALSE(path_point_of(skeleton_, 9, Stamp{seconds{110}}));
  EXPECT_FALSE(path_point_of(skeleton_, 2, Stamp{seconds{99}}));
  const auto late = path_point_of(skeleton_, 2, Stamp{seconds{130}} + milliseconds{300});
  ASSERT_TRUE(late);  // just behind its newest origin
  EXPECT_EQ(late->maplet, (MapletKey{2, 20, 3}));
  EXPECT_NEAR(late->covariance(0, 0), 0.09, 1e-6);
}

}  // namespace
}  // namespace maplet
