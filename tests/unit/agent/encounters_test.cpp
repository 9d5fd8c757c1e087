// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/encounters.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "core/maplet/codec.hpp"
#include "tests/support/furnished.hpp"

namespace maplet {
namespace {

constexpr double kStorey_m = 3.0;

/// Two agents, one of them us, go up from room to room, each a seed of test::furnished.
class EncountersTest : public testing::Test {
 protected:
  static constexpr std::uint16_t kUs = 1;
  static constexpr std::uint16_t kOther = 2;

  /// What an agent sees in each room, and how it went from one to the next.
  void go(std::uint16_t agent, const std::vector<unsigned>& rooms, std::uint32_t first = 0) {
    for (std::size_t i = 0; i < rooms.size(); ++i) {
      const auto id = static_cast<std::uint32_t>(first + i);
      const auto maplet = test::view(test::furnished(rooms[i]), stands(agent), agent, id);
      std::vector<std::byte> bytes(1 << 14);
      const auto size = encode(*maplet, bytes);
      ASSERT_TRUE(size);
      bytes.resize(*size);
      skeleton_.add(maplet->key);
      if (id > 0) link(agent, id);
      if (agent == kUs) {
        ASSERT_TRUE(own_.put(maplet->key, bytes));
        encounters_.add_own(*maplet);
      } else {
        ASSERT_TRUE(encounters_.hear(maplet->key, bytes));
      }
    }
  }

  /// Until all is compared. @return what was told
  std::vector<DeltaPose> compare() {
    std::vector<DeltaPose> told;
    for (int k = 0; k < 10000 && encounters_.busy(); ++k) {
      for (const DeltaPose& closure :
           encounters_.work(skeleton_, own_, {kUs, 1, 0}, Deadline::never())) {
        told.push_back(closure);
        skeleton_.add(closure, Deadline::never());
      }
    }
    EXPECT_TRUE(skeleton_.settle(Deadline::never()));
    return told;
  }

  [[nodiscard]] bool together() const {
    return skeleton_.gauge({kUs, 1, 0}) == skeleton_.gauge({kOther, 1, 0});
  }

  /// Where each agent stands in a room.
  static Se3 stands(std::uint16_t agent) {
    return agent == kUs ? test::camera_at({-1.5, 0.2, 1.2}, 0.1)
                        : test::camera_at({-1.2, -0.3, 1.1}, 0.4);
  }

  Arena arena_;
  Skeleton skeleton_{{.max_nodes = 64, .max_factors = 128}, arena_};

 private:
  void link(std::uint16_t agent, std::uint32_t id) {
    DeltaPose d;
    d.a = {agent, 1, id - 1};
    d.b = {agent, 1, id};
    const Se3 next{Eigen::Quaterniond::Identity(), {0.0, 0.0, kStorey_m}};
    d.T_a_b.se3 = stands(agent).inverse() * next * stands(agent);
    d.covariance = 1e-4 * Matrix6d::Identity();
    ASSERT_EQ(skeleton_.add(d, Deadline::never()), Added::kLinked);
  }

  MapletStore own_{64, 4096, 1 << 14, arena_};
  Encounters encounters_{{}, {.own = 64, .foreign = 64, .maplet_bytes = 1 << 14}, arena_};
};

TEST_F(EncountersTest, PlacesThatBothSawAreTold) {
  go(kUs, {7, 8, 9});
  go(kOther, {7, 8, 9});
  const auto told = compare();
  ASSERT_EQ(told.size(), 3U);
  for (const DeltaPose& closure : told) {
    EXPECT_EQ(closure.kind, DeltaPose::Kind::kClosure);
    EXPECT_EQ(closure.a.id, closure.b.id);
    const bool ours_first = closure.a.agent == kUs;
    const Se3 truth =
        stands(ours_first ? kUs : kOther).inverse() * stands(ours_first ? kOther : kUs);
    EXPECT_LT((truth.inverse() * closure.T_a_b.se3).log().norm(), 0.01);
  }
  EXPECT_TRUE(together());
}

TEST_F(EncountersTest, OnePairAloneIsNotTold) {
  go(kUs, {7});
  go(kOther, {7});
  EXPECT_TRUE(compare().empty());
  EXPECT_FALSE(together());
}

// Two rooms of two houses are alike; the third says that it is two houses.
TEST_F(EncountersTest, WhatLiesAroundIsLookedAt) {
  go(kUs, {7, 8, 12});
  go(kOther, {7, 8, 13});
  EXPECT_TRUE(compare().empty());
  EXPECT_FALSE(together());
}

// What was told of two rooms has a rival each once the other agent has seen two more that are just
// like them: nobody can tell which are meant.
TEST_F(EncountersTest, RivalsThatTurnUpLaterAreTold) {
  go(kUs, {7, 8});
  go(kOther, {7, 8});
  EXPECT_EQ(compare().size(), 2U);
  EXPECT_TRUE(together());
  go(kOther, {7, 8}, 2);
  const auto rivals = compare();
  ASSERT_EQ(rivals.size(), 2U);
  for (const DeltaPose& closure : rivals) {
    const MapletKey& ours = closure.a.agent == kUs ? closure.a : closure.b;
    const MapletKey& theirs = closure.a.agent == kUs ? closure.b : closure.a;
    EXPECT_EQ(theirs.id, ours.id + 2);
  }
  EXPECT_FALSE(together());
  for (int i = 0; i < skeleton_.factor_count(); ++i) {
    const auto factor = skeleton_.factor(i);
    const bool closure = factor.kind == DeltaPose::Kind::kClosure;
    EXPECT_EQ(factor.verdict, closure ? ClosureState::kTorn : ClosureState::kNone);
  }
  EXPECT_TRUE(compare().empty()) << "one for one";
}

}  // namespace
}  // namespace maplet
