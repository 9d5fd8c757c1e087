// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <set>
#include <vector>

#include "core/agent/agent.hpp"

namespace maplet {
namespace {

struct NoMeter final : StageMeter {
  void begin(Stage) noexcept override {}
  void end(Stage, Duration) noexcept override {}
};

struct Echo final : RecordSink {
  int records = 0;
  std::optional<DeltaPose> put(const DeltaPose& delta) noexcept override {
    ++records;
    return delta;
  }
  std::optional<MapletRange> put(const MapletRange& range) noexcept override {
    ++records;
    return range;
  }
};

DeltaPose delta(std::uint16_t agent_a, std::uint32_t a, std::uint16_t agent_b, std::uint32_t b,
                double x_m, DeltaPose::Kind kind = DeltaPose::Kind::kConsecutive) {
  DeltaPose d;
  d.kind = kind;
  d.a = {agent_a, 1, a};
  d.b = {agent_b, 1, b};
  d.T_a_b.se3.t.x() = x_m;
  d.covariance = 1e-4 * Matrix6d::Identity();
  return d;
}

class Hearing : public testing::Test {
 protected:
  Arena arena_;
  NoMeter meter_;
  Echo records_;
  Agent agent_{AgentConfig{}, AgentIdentity{1, 1}, meter_, records_, arena_};

  void hear_paths() {
    for (const std::uint16_t who : std::array<std::uint16_t, 2>{1, 2}) {
      for (std::uint32_t i = 0; i < 4; ++i) {
        EXPECT_EQ(agent_.hear(delta(who, i, who, i + 1, 2.0), Deadline::never()), Added::kLinked);
      }
    }
  }
};

TEST_F(Hearing, OthersStandAsideUntilAClosureRelatesThem) {
  hear_paths();
  const Skeleton& skeleton = agent_.skeleton();
  EXPECT_NE(skeleton.gauge({1, 1, 0}), skeleton.gauge({2, 1, 0}));
  EXPECT_EQ(agent_.hear(delta(1, 4, 2, 0, 1.0, DeltaPose::Kind::kClosure), Deadline::never()),
            Added::kLinked);
  ASSERT_EQ(skeleton.gauge({1, 1, 0}), skeleton.gauge({2, 1, 4}));
  EXPECT_NEAR(skeleton.pose({2, 1, 4})->t.x() - skeleton.pose({1, 1, 0})->t.x(), 17.0, 0.01);
}

TEST_F(Hearing, RecordsTwiceChangeNothing) {
  hear_paths();
  const int factors = agent_.skeleton().factor_count();
  EXPECT_EQ(agent_.hear(delta(2, 0, 2, 1, 2.0), Deadline::never()), Added::kDuplicate);
  EXPECT_EQ(agent_.skeleton().factor_count(), factors);
}

TEST_F(Hearing, AClosureFarFromTheSkeletonCountsForNothing) {
  hear_paths();
  ASSERT_EQ(agent_.hear(delta(1, 4, 2, 0, 1.0, DeltaPose::Kind::kClosure), Deadline::never()),
            Added::kLinked);
  const int factors = agent_.skeleton().factor_count();
  const DeltaPose wrong = delta(1, 0, 2, 4, 40.0, DeltaPose::Kind::kClosure);
  EXPECT_EQ(agent_.hear(wrong, Deadline::never()), Added::kLinked);
  EXPECT_EQ(agent_.skeleton().factor(factors).verdict, ClosureState::kRejected);
  EXPECT_EQ(agent_.hear(delta(1, 0, 2, 4, 17.01, DeltaPose::Kind::kClosure), Deadline::never()),
            Added::kLinked);
  EXPECT_EQ(agent_.skeleton().factor(factors + 1).verdict, ClosureState::kAccepted);
}

// Whoever hears the same records in another order settles alike.
TEST_F(Hearing, TheOrderOfRecordsDoesNotMatterOnceSettled) {
  std::vector<DeltaPose> records;
  for (const std::uint16_t who : std::array<std::uint16_t, 3>{1, 2, 3}) {
    for (std::uint32_t i = 0; i < 6; ++i)
      records.push_back(delta(who, i, who, i + 1, 2.0 + 0.003 * who * i));
  }
  const auto closure = DeltaPose::Kind::kClosure;
  records.push_back(delta(1, 6, 2, 0, 1.0, closure));
  records.push_back(delta(1, 5, 2, 1, 5.02, closure));
  records.push_back(delta(1, 5, 2, 1, 5.01, closure));  // the other agent's look at the same pair
  records.push_back(delta(2, 6, 3, 0, 1.0, closure));
  records.push_back(delta(1, 0, 2, 4, 40.0, closure));  // false ones
  records.push_back(delta(1, 1, 3, 4, -7.0, closure));
  for (const DeltaPose& record : records) (void)agent_.hear(record, Deadline::never());
  ASSERT_TRUE(agent_.settle(Deadline::never()));
  EXPECT_TRUE(agent_.settled());
  std::mt19937 rng{7};
  for (int k = 0; k < 10; ++k) {
    std::ranges::shuffle(records, rng);
    Arena arena;
    Agent other{AgentConfig{}, AgentIdentity{2, 1}, meter_, records_, arena};
    for (const DeltaPose& record : records) (void)other.hear(record, Deadline::never());
    EXPECT_FALSE(other.settled());
    ASSERT_TRUE(other.settle(Deadline::never()));
    EXPECT_EQ(other.skeleton().records_digest(), agent_.skeleton().records_digest());
    for (int i = 0; i < agent_.skeleton().node_count(); ++i) {
      const Skeleton::NodeView node = agent_.skeleton().node(i);
      ASSERT_NE(other.skeleton().pose(node.key), nullptr);
      const Se3 apart = node.T_world_maplet.inverse() * *other.skeleton().pose(node.key);
      EXPECT_LT(apart.t.norm(), 1e-6);
      EXPECT_LT(apart.angle(), 1e-6);
    }
    std::multiset<double> counts_here, counts_there;
    const auto& here = agent_.skeleton();
    for (int i = 0; i < here.factor_count(); ++i) {
      if (here.factor(i).weight > 0.0) counts_here.insert(here.factor(i).T_a_b.t.x());
      if (other.skeleton().factor(i).weight > 0.0)
        counts_there.insert(other.skeleton().factor(i).T_a_b.t.x());
    }
    EXPECT_EQ(counts_here, counts_there);
  }
}

TEST_F(Hearing, OverlapIsExpectedWhereTheSkeletonPutsOthersNearUs) {
  std::array<MapletKey, 8> near;
  hear_paths();
  EXPECT_EQ(agent_.expected_near(near), 0U);  // nothing relates the two
  // Their path goes on from ours: 2:0 is 1 m behind the end of ours, 2:4 is 9 m behind it.
  (void)agent_.hear(delta(1, 4, 2, 0, 1.0, DeltaPose::Kind::kClosure), Deadline::never());
  ASSERT_EQ(agent_.expected_near(near), 5U);
  for (std::uint32_t i = 0; i < 5; ++i) EXPECT_EQ(near[i], (MapletKey{2, 1, i}));
  for (std::uint32_t i = 4; i < 8; ++i)
    (void)agent_.hear(delta(2, i, 2, i + 1, 2.0), Deadline::never());
  EXPECT_EQ(agent_.expected_near(near), 5U);  // 11 m and more away
  EXPECT_EQ(agent_.expected_near(std::span{near}.first(2)), 2U);
}

TEST_F(Hearing, ARangeBecomesARecordThatTheGraphHolds) {
  hear_paths();
  const MapletRange range{{1, 1, 2}, {2, 1, 3}, Stamp{}, 5.0, 0.1};
  EXPECT_EQ(agent_.hear(range, Deadline::never()), Added::kLinked);
  EXPECT_EQ(agent_.hear({{1, 1, 2}, {7, 1, 0}, Stamp{}, 5.0, 0.1}, Deadline::never()),
            Added::kWaiting);  // of an agent whose path is not known yet
  EXPECT_EQ(agent_.hear({{1, 1, 2}, {2, 1, 3}, Stamp{}, 0.0, 0.1}, Deadline::never()),
            Added::kBadMeasurement);
}

TEST_F(Hearing, SettlingBeginsOnlyWhereThereIsTimeForIt) {
  hear_paths();
  const MonotonicClock clock;
  EXPECT_FALSE(agent_.settle(Deadline{clock, std::chrono::microseconds{10}}));
  EXPECT_TRUE(agent_.settle(Deadline{clock, std::chrono::seconds{60}}));
}

TEST_F(Hearing, WhatAnOperatorClaimsBecomesARecordEvenIfRefusedHere) {
  hear_paths();
  EXPECT_TRUE(agent_.say(delta(1, 4, 2, 0, 1.0, DeltaPose::Kind::kClosure), Deadline::never()));
  EXPECT_FALSE(agent_.say(delta(1, 0, 2, 4, 40.0, DeltaPose::Kind::kClosure), Deadline::never()));
  EXPECT_EQ(records_.records, 2);
}

TEST_F(Hearing, NonsenseIsNoMaplet) {
  const std::array<std::byte, 100> nonsense{};
  EXPECT_FALSE(agent_.hear(MapletKey{2, 1, 0}, nonsense));
  EXPECT_FALSE(agent_.meet(Deadline::never()));
}

}  // namespace
}  // namespace maplet
