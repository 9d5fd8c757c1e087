// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/skeleton.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace maplet {
namespace {

MapletKey key(std::uint16_t agent, std::uint32_t id) { return {agent, 7, id}; }

DeltaPose delta(MapletKey a, MapletKey b, double x, double yaw = 0.0) {
  DeltaPose d;
  d.a = a;
  d.b = b;
  d.T_a_b.se3.t.x() = x;
  d.T_a_b.se3.q = Eigen::Quaterniond{std::cos(0.5 * yaw), 0.0, 0.0, std::sin(0.5 * yaw)};
  d.covariance = 1e-4 * Matrix6d::Identity();
  return d;
}

class SkeletonTest : public testing::Test {
 protected:
  Arena arena_;
  Skeleton skeleton_{{.max_nodes = 16, .max_factors = 24, .condense = false}, arena_};
  Deadline never_ = Deadline::never();
};

TEST_F(SkeletonTest, PutsMapletsWhereDeltaPosesSay) {
  EXPECT_EQ(skeleton_.add(delta(key(1, 0), key(1, 1), 2.0), never_), Added::kLinked);
  EXPECT_EQ(skeleton_.add(delta(key(1, 1), key(1, 2), 3.0), never_), Added::kLinked);
  ASSERT_NE(skeleton_.pose(key(1, 2)), nullptr);
  EXPECT_NEAR(skeleton_.pose(key(1, 2))->t.x(), 5.0, 1e-9);
  EXPECT_EQ(skeleton_.pose(key(1, 3)), nullptr);
  EXPECT_EQ(skeleton_.node_count(), 3);
  EXPECT_EQ(skeleton_.node(2).key, key(1, 2));
}

TEST_F(SkeletonTest, ClosesASquare) {
  constexpr double kQuarter = 1.5707963267948966;
  for (std::uint32_t i = 0; i < 4; ++i)
    skeleton_.add(delta(key(1, i), key(1, i + 1), 1.02, kQuarter), never_);
  DeltaPose closure = delta(key(1, 0), key(1, 4), 0.0);
  closure.kind = DeltaPose::Kind::kClosure;
  closure.T_a_b.se3.t.y() = 0.05;
  skeleton_.add(closure, never_);
  skeleton_.update(never_);
  EXPECT_LT((skeleton_.pose(key(1, 4))->t - Eigen::Vector3d{0.0, 0.05, 0.0}).norm(), 0.05);
  EXPECT_GT(skeleton_.chi2(), 0.0);
  EXPECT_EQ(skeleton_.factor_count(), 5);
  EXPECT_EQ(skeleton_.factor(4).kind, DeltaPose::Kind::kClosure);
  EXPECT_GT(skeleton_.factor(4).chi2, 0.0);
}

TEST_F(SkeletonTest, AGapHoldsNothingUntilAClosureJoinsBothSides) {
  skeleton_.add(delta(key(1, 0), key(1, 1), 1.0), never_);
  DeltaPose gap = delta(key(1, 1), key(1, 2), 4.0, 1.0);
  gap.covariance = 9.0 * Matrix6d::Identity();
  gap.covariance.diagonal().tail<3>().setConstant(1.8 * 1.8);
  EXPECT_EQ(skeleton_.add(gap, never_), Added::kLoose);
  EXPECT_EQ(skeleton_.add(gap, never_), Added::kLoose) << "again";
  skeleton_.add(delta(key(1, 2), key(1, 3), 1.0), never_);
  EXPECT_EQ(skeleton_.node_count(), 4);
  EXPECT_EQ(skeleton_.factor_count(), 2);
  EXPECT_NE(skeleton_.gauge(key(1, 0)), skeleton_.gauge(key(1, 3)));
  DeltaPose closure = delta(key(1, 0), key(1, 3), 0.5);
  closure.kind = DeltaPose::Kind::kClosure;
  EXPECT_EQ(skeleton_.add(closure, never_), Added::kLinked);
  skeleton_.update(never_);
  EXPECT_EQ(skeleton_.gauge(key(1, 0)), skeleton_.gauge(key(1, 3)));
  EXPECT_NEAR((skeleton_.pose(key(1, 0))->inverse() * *skeleton_.pose(key(1, 3))).t.x(), 0.5, 0.01);
}

TEST_F(SkeletonTest, AgentsStandSideBySideUntilTheyMeet) {
  skeleton_.add(delta(key(2, 0), key(2, 1), 1.0), never_);
  skeleton_.add(delta(key(1, 0), key(1, 1), 1.0), never_);
  EXPECT_NE(skeleton_.gauge(key(2, 1)), skeleton_.gauge(key(1, 1)));
  DeltaPose meeting = delta(key(2, 1), key(1, 1), 5.0);
  meeting.kind = DeltaPose::Kind::kClosure;
  EXPECT_EQ(skeleton_.add(meeting, never_), Added::kLinked);
  EXPECT_EQ(skeleton_.gauge(key(2, 1)), key(1, 0));  // the lowest agent's first
  EXPECT_NEAR(skeleton_.pose(key(1, 1))->t.x() - skeleton_.pose(key(2, 1))->t.x(), 5.0, 1e-9);
  EXPECT_EQ(skeleton_.counters().joined_groups, 1u);
  EXPECT_NEAR(skeleton_.pose(key(1, 0))->t.norm(), 0.0, 1e-9);
}

TEST_F(SkeletonTest, TurnsAwayWhatMakesNoSense) {
  skeleton_.add(delta(key(1, 0), key(1, 1), 1.0), never_);
  DeltaPose bad = delta(key(1, 1), key(1, 2), 1.0);
  bad.covariance(3, 3) = -1.0;
  EXPECT_EQ(skeleton_.add(bad, never_), Added::kBadMeasurement);
  bad = delta(key(1, 1), key(1, 2), std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(skeleton_.add(bad, never_), Added::kBadMeasurement);
  EXPECT_EQ(skeleton_.add(delta(key(1, 1), key(1, 1), 1.0), never_), Added::kBadMeasurement);
  EXPECT_EQ(skeleton_.add(delta(key(1, 0), key(1, 1), 1.0), never_), Added::kDuplicate);
  EXPECT_EQ(skeleton_.node_count(), 2);
  EXPECT_EQ(skeleton_.factor_count(), 1);
  EXPECT_EQ(skeleton_.counters().bad_measurements, 3u);
  EXPECT_EQ(skeleton_.counters().duplicates, 1u);
}

TEST_F(SkeletonTest, SaysWhenItIsFull) {
  for (std::uint32_t i = 0; i < 15; ++i)
    EXPECT_EQ(skeleton_.add(delta(key(1, i), key(1, i + 1), 1.0), never_), Added::kLinked);
  EXPECT_EQ(skeleton_.add(delta(key(1, 15), key(1, 16), 1.0), never_), Added::kNodesFull);
  EXPECT_EQ(skeleton_.counters().nodes_full, 1u);
  EXPECT_NEAR(skeleton_.pose(key(1, 15))->t.x(), 15.0, 1e-9);
}

TEST_F(SkeletonTest, SurvivesABillionMetres) {
  skeleton_.add(delta(key(1, 0), key(1, 1), 1e9), never_);
  skeleton_.add(delta(key(1, 1), key(1, 2), -1e9, 0.5), never_);
  skeleton_.add(delta(key(1, 0), key(1, 2), 3.0, 0.4), never_);
  skeleton_.update(never_);
  EXPECT_TRUE(skeleton_.pose(key(1, 2))->t.allFinite());
}

// Both maplets stay, their closures go, and that is not enough for a third.
TEST(SkeletonAtItsLimits, FactorsDroppedInVainAreForgotten) {
  Arena arena;
  Skeleton skeleton{{.max_nodes = 2, .max_factors = 8}, arena};
  const Deadline never = Deadline::never();
  skeleton.add(delta(key(1, 0), key(1, 1), 1.0), never);
  const auto meet = [&](std::int64_t when) {
    DeltaPose closure = delta(key(1, 0), key(1, 1), 1.0);
    closure.kind = DeltaPose::Kind::kClosure;
    closure.stamp_b = Stamp{Duration{when}};
    return skeleton.add(closure, never);
  };
  for (int k = 1; k <= 5; ++k) ASSERT_EQ(meet(k), Added::kLinked);
  ASSERT_EQ(skeleton.factor_count(), 6);
  EXPECT_EQ(skeleton.add(delta(key(1, 1), key(1, 2), 1.0), never), Added::kNodesFull);
  EXPECT_EQ(skeleton.counters().dropped, 5u);
  EXPECT_EQ(skeleton.factor_count(), 1);
  EXPECT_EQ(meet(6), Added::kLinked);
  ASSERT_EQ(skeleton.factor_count(), 2);
  for (int k = 0; k < 2; ++k) EXPECT_EQ(skeleton.factor(k).b, key(1, 1));
}

}  // namespace
}  // namespace maplet
