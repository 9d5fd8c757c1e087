// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/surroundings.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace maplet {
namespace {

Se3 ahead(double m) { return {Eigen::Quaterniond::Identity(), Eigen::Vector3d{m, 0.0, 0.0}}; }

MapletKey key(std::uint16_t agent, std::uint32_t id) { return {agent, 1, id}; }

TEST(Surroundings, PairsComeNearestFirstWithinReach) {
  Surroundings around;
  around.begin(key(1, 0), key(2, 0), ahead(0.5));
  around.put_beside_a(key(1, 3), ahead(7.9));
  around.put_beside_a(key(1, 1), ahead(2.0));
  around.put_beside_a(key(1, 4), ahead(8.1));  // out of reach
  around.put_beside_b(key(2, 2), ahead(-3.0));
  std::vector<std::pair<std::uint32_t, std::uint32_t>> seen;
  while (const Surroundings::Pair* pair = around.next()) {
    seen.emplace_back(pair->a.id, pair->b.id);
    EXPECT_LE(pair->apart_m, Surroundings::kReach_m);
    const double at_a = pair->a.id == 0 ? 0.0 : pair->a.id == 1 ? 2.0 : 7.9;
    const double at_b = pair->b.id == 0 ? 0.0 : -3.0;
    EXPECT_NEAR(pair->T_a_b.t.x(), 0.5 + at_b - at_a, 1e-12);
  }
  const std::vector<std::pair<std::uint32_t, std::uint32_t>> expected{
      {1, 0}, {0, 2}, {1, 2}, {3, 0}};  // 3 and 2 together are too far
  EXPECT_EQ(seen, expected);
}

TEST(Surroundings, OfManyTheNearestAreKept) {
  Surroundings around;
  around.begin(key(1, 0), key(2, 0), Se3{});
  for (std::uint32_t i = 1; i <= 40; ++i) {
    around.put_beside_a(key(1, i), ahead(0.1 * (41 - i)));
    around.put_beside_b(key(2, i), ahead(0.1 * (41 - i)));
  }
  int count = 0;
  double before = 0.0;
  while (const Surroundings::Pair* pair = around.next()) {
    ++count;
    EXPECT_GE(pair->apart_m, before);
    before = pair->apart_m;
    EXPECT_TRUE(pair->a.id == 0 || pair->a.id > 33);
  }
  EXPECT_EQ(count, 32);
}

TEST(Surroundings, AShareOfWhatWasLookedThroughDecides) {
  Surroundings around;
  around.begin(key(1, 0), key(2, 0), Se3{});
  EXPECT_FALSE(around.contradict());  // nothing was seen
  Evidence evidence;
  evidence.agreed = 40.0;
  evidence.contradicted = 2.0;
  around.weigh(evidence);
  EXPECT_FALSE(around.contradict());
  Evidence cut = evidence;
  cut.contradicted = 40.0;
  cut.complete = false;  // the deadline came first
  around.weigh(cut);
  EXPECT_FALSE(around.contradict());
  evidence.contradicted = 6.0;
  around.weigh(evidence);
  EXPECT_TRUE(around.contradict());
  around.begin(key(1, 0), key(2, 0), Se3{});
  EXPECT_FALSE(around.contradict());
}

}  // namespace
}  // namespace maplet
