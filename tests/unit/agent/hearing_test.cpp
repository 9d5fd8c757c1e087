// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>

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

TEST_F(Hearing, AClosureFarFromTheSkeletonIsRefusedAndRemembered) {
  hear_paths();
  ASSERT_EQ(agent_.hear(delta(1, 4, 2, 0, 1.0, DeltaPose::Kind::kClosure), Deadline::never()),
            Added::kLinked);
  const int factors = agent_.skeleton().factor_count();
  const DeltaPose wrong = delta(1, 0, 2, 4, 40.0, DeltaPose::Kind::kClosure);
  EXPECT_EQ(agent_.hear(wrong, Deadline::never()), Added::kBadMeasurement);
  EXPECT_EQ(agent_.skeleton().factor_count(), factors);
  ASSERT_EQ(agent_.refused().size(), 1U);
  EXPECT_EQ(agent_.refused()[0].b, (MapletKey{2, 1, 4}));
  EXPECT_EQ(agent_.hear(delta(1, 0, 2, 4, 17.2, DeltaPose::Kind::kClosure), Deadline::never()),
            Added::kLinked);
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
