// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What navigation and other agents take from the skeleton.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <random>
#include <vector>

#include "core/skeleton/map_odom.hpp"
#include "core/skeleton/overlay.hpp"
#include "core/skeleton/skeleton.hpp"

namespace maplet {
namespace {

MapletKey key(std::uint16_t agent, std::uint32_t id) { return {agent, 7, id}; }

DeltaPose delta(MapletKey a, MapletKey b, double x, double y = 0.0, double yaw = 0.0) {
  DeltaPose d;
  d.a = a;
  d.b = b;
  d.T_a_b.se3.t = {x, y, 0.0};
  d.T_a_b.se3.q = Eigen::Quaterniond{std::cos(0.5 * yaw), 0.0, 0.0, std::sin(0.5 * yaw)};
  d.covariance = 1e-4 * Matrix6d::Identity();
  return d;
}
DeltaPose closure(MapletKey a, MapletKey b, double x, double y = 0.0, double yaw = 0.0) {
  DeltaPose d = delta(a, b, x, y, yaw);
  d.kind = DeltaPose::Kind::kClosure;
  return d;
}

const Deadline kNever = Deadline::never();

TEST(MapOdom, OdometryStaysSmoothAndJumpsAreCounted) {
  MapOdom frame;
  Se3 body;
  EXPECT_FALSE(frame.update(body, body));
  for (int i = 0; i < 10; ++i) {  // a small correction at each step is none
    body.t.x() += 0.1;
    Se3 in_map = body;
    in_map.t.y() += 0.01 * i;
    EXPECT_FALSE(frame.update(in_map, body));
  }
  EXPECT_EQ(frame.jumps(), 0u);
  Se3 closed = body;
  closed.t.y() += 1.0;
  EXPECT_TRUE(frame.update(closed, body));
  EXPECT_EQ(frame.jumps(), 1u);
  EXPECT_LT((frame.T_map_odom() * body).t.x() - closed.t.x(), 1e-12);
}

/// A corridor of ten maplets with a door from the first to the eighth.
TEST(SkeletonWay, TakesTheDoor) {
  Arena arena;
  Skeleton skeleton{{.max_nodes = 64, .max_factors = 128}, arena};
  for (std::uint32_t i = 0; i < 9; ++i)
    skeleton.add(delta(key(1, i), key(1, i + 1), 1.0, 0.0, 2.0 * M_PI / 10.0), kNever);
  std::array<MapletKey, 16> maplets;
  auto way = skeleton.way(key(1, 0), key(1, 7), maplets);
  EXPECT_EQ(way.count, 8);
  skeleton.add(closure(key(1, 9), key(1, 0), 1.0, 0.0, 2.0 * M_PI / 10.0), kNever);
  way = skeleton.way(key(1, 0), key(1, 7), maplets);
  ASSERT_EQ(way.count, 4);
  EXPECT_EQ(maplets[1], key(1, 9));
  EXPECT_NEAR(way.length_m, 3.0, 0.05);
  EXPECT_EQ(skeleton.way(key(1, 0), key(2, 0), maplets).count, 0);
  EXPECT_EQ(skeleton.way(key(1, 0), key(1, 7), std::span{maplets}.first(2)).count, 0);
}

class OneMaplet final : public MapletLookup {
 public:
  OneMaplet() {
    maplet_->planes.resize(3);
    for (std::size_t i = 0; i < 3; ++i) maplet_->planes[i].area_m2 = std::array{6.0, 3.0, 1.0}[i];
  }
  const Maplet* find(const MapletKey& key) noexcept override {
    return key.id == 1 ? nullptr : maplet_.get();
  }

 private:
  std::unique_ptr<Maplet> maplet_ = std::make_unique<Maplet>();
};

TEST(SkeletonOverlay, ShowsAsMuchAsWasAskedFor) {
  Arena arena;
  Skeleton skeleton{{.max_nodes = 64, .max_factors = 128}, arena};
  skeleton.add(delta(key(1, 0), key(1, 1), 1.0), kNever);
  skeleton.add(delta(key(1, 1), key(1, 2), 1.0), kNever);
  skeleton.add(key(2, 0));  // another group
  OneMaplet maplets;
  std::vector<double> d;
  const auto show = [&](const PlacedPlane& p) { d.push_back(p.T_world_maplet.t.x()); };
  Overlay out = lay_over(skeleton, key(1, 0), maplets, 1.0, show);
  EXPECT_EQ(out.maplets, 2);
  EXPECT_EQ(out.missing, 1);
  EXPECT_EQ(out.planes, 6);
  EXPECT_NEAR(out.area_m2, 20.0, 1e-9);
  EXPECT_NEAR(d.back(), 2.0, 1e-6);
  out = lay_over(skeleton, key(1, 0), maplets, 0.6, show);
  EXPECT_EQ(out.planes, 2);
  out = lay_over(skeleton, key(1, 0), maplets, 0.8, show);
  EXPECT_EQ(out.planes, 4);
}

TEST(SkeletonClosures, AMergeIsReversible) {
  Arena arena;
  Skeleton skeleton{{.max_nodes = 64, .max_factors = 128}, arena};
  for (const std::uint16_t agent : {std::uint16_t{1}, std::uint16_t{2}})
    for (std::uint32_t i = 0; i < 4; ++i)
      skeleton.add(delta(key(agent, i), key(agent, i + 1), 1.0), kNever);
  skeleton.add(closure(key(1, 2), key(2, 2), 0.0, 1.0), kNever);
  EXPECT_EQ(skeleton.gauge(key(2, 0)), key(1, 0));
  EXPECT_NEAR(skeleton.pose(key(2, 2))->t.y(), 1.0, 1e-6);
  EXPECT_EQ(skeleton.decide(key(1, 2), key(2, 2), false, kNever), 1);
  EXPECT_EQ(skeleton.gauge(key(2, 3)), key(2, 0));
  EXPECT_NEAR(skeleton.pose(key(2, 0))->t.norm(), 0.0, 1e-9);
  EXPECT_NEAR(skeleton.pose(key(2, 3))->t.x(), 3.0, 1e-6);
  EXPECT_EQ(skeleton.factor(8).verdict, ClosureState::kForced);
  EXPECT_EQ(skeleton.factor(8).weight, 0.0);
  EXPECT_EQ(skeleton.decide(key(2, 2), key(1, 2), true, kNever), 1);
  EXPECT_EQ(skeleton.gauge(key(2, 3)), key(1, 0));
  EXPECT_EQ(skeleton.decide(key(2, 2), key(1, 1), true, kNever), 0);
  EXPECT_EQ(skeleton.counters().damped_pivots, 0u);
}

TEST(SkeletonClosures, OneThatCannotBeIsLeftOut) {
  Arena arena;
  Skeleton skeleton{{.max_nodes = 64, .max_factors = 128}, arena};
  for (std::uint32_t i = 0; i < 9; ++i) skeleton.add(delta(key(1, i), key(1, i + 1), 1.0), kNever);
  skeleton.add(closure(key(1, 0), key(1, 9), 2.0), kNever);
  EXPECT_EQ(skeleton.factor(9).verdict, ClosureState::kRejected);
  EXPECT_NEAR(skeleton.pose(key(1, 9))->t.x(), 9.0, 1e-6);
  DeltaPose again = closure(key(1, 0), key(1, 9), 9.01);
  again.stamp_b = Stamp{1};
  skeleton.add(again, kNever);
  EXPECT_EQ(skeleton.factor(10).verdict, ClosureState::kAccepted);
}

/// Records of three agents; two closures of the third to the first are wrong and do not agree.
std::vector<DeltaPose> records() {
  std::vector<DeltaPose> out;
  std::mt19937 random{4};
  std::normal_distribution<double> noise{0.0, 0.01};
  for (const std::uint16_t agent : {std::uint16_t{1}, std::uint16_t{2}, std::uint16_t{3}})
    for (std::uint32_t i = 0; i < 12; ++i) {
      const std::array<double, 3> off{noise(random), noise(random), noise(random)};
      out.push_back(delta(key(agent, i), key(agent, i + 1), 1.0 + off[2], off[1], 0.3 + off[0]));
    }
  const auto meet = [&](std::uint16_t a, std::uint16_t b, std::uint32_t i) {
    const std::array<double, 2> off{noise(random), noise(random)};
    out.push_back(closure(key(a, i), key(b, i), off[1], off[0]));
  };
  for (const std::uint32_t i : {2u, 6u, 9u}) meet(1, 2, i);
  for (const std::uint32_t i : {3u, 5u, 8u}) meet(2, 3, i);
  out.push_back(closure(key(1, 1), key(3, 8), 3.0, -2.0, 1.0));
  out.push_back(closure(key(1, 4), key(3, 10), -4.0, 7.0, 2.0));
  return out;
}

TEST(SkeletonSettle, DependsOnTheSetOfRecordsAlone) {
  std::vector<DeltaPose> set = records();
  Arena arena;
  Skeleton first{{.max_nodes = 64, .max_factors = 128}, arena};
  for (const DeltaPose& d : set) first.add(d, kNever);
  EXPECT_FALSE(first.canonical());
  ASSERT_TRUE(first.settle(kNever));
  EXPECT_TRUE(first.canonical());
  std::mt19937 random{8};
  for (int round = 0; round < 5; ++round) {
    std::shuffle(set.begin(), set.end(), random);
    Arena other_arena;
    Skeleton other{{.max_nodes = 64, .max_factors = 128}, other_arena};
    for (const DeltaPose& d : set) other.add(d, kNever);
    ASSERT_TRUE(other.settle(kNever));
    EXPECT_EQ(other.records_digest(), first.records_digest());
    EXPECT_NEAR(other.chi2(), first.chi2(), 1e-9);
    for (int i = 0; i < first.node_count(); ++i) {
      const auto node = first.node(i);
      ASSERT_NE(other.pose(node.key), nullptr);
      EXPECT_EQ(other.gauge(node.key), node.gauge);
      EXPECT_LT((*other.pose(node.key)).t.x() - node.T_world_maplet.t.x(), 1e-7);
      EXPECT_LT((other.pose(node.key)->inverse() * node.T_world_maplet).log().norm(), 1e-7);
    }
  }
  int rejected = 0;
  for (int i = 0; i < first.factor_count(); ++i)
    rejected += first.factor(i).verdict == ClosureState::kRejected ? 1 : 0;
  EXPECT_EQ(rejected, 2);
  const auto before = first.records_digest();
  first.add(delta(key(1, 12), key(1, 13), 1.0), kNever);
  EXPECT_NE(first.records_digest(), before);
}

/// Two agents whose paths run side by side; closures put the second `at_m` along the first.
struct SideBySide {
  Arena arena;
  Skeleton skeleton{{.max_nodes = 64, .max_factors = 128}, arena};

  SideBySide() {
    for (const std::uint16_t who : {std::uint16_t{1}, std::uint16_t{2}})
      for (std::uint32_t i = 0; i < 9; ++i)
        skeleton.add(delta(key(who, i), key(who, i + 1), 1.0), kNever);
  }
  void meet(std::uint32_t a, std::uint32_t b, double at_m) {
    EXPECT_EQ(skeleton.add(closure(key(1, a), key(2, b), at_m + double(b) - double(a)), kNever),
              Added::kLinked);
  }
  /// Two closures put it at 0, two at 4 m.
  void meet_both_ways() {
    for (const std::uint32_t i : {0U, 2U}) meet(i, i, 0.0);
    for (const std::uint32_t i : {1U, 3U}) meet(i, i + 4, 4.0);
  }
  [[nodiscard]] bool together() const {
    return skeleton.gauge(key(1, 0)) == skeleton.gauge(key(2, 0));
  }
  [[nodiscard]] int torn() const {
    int count = 0;
    for (int i = 0; i < skeleton.factor_count(); ++i)
      count += skeleton.factor(i).verdict == ClosureState::kTorn ? 1 : 0;
    return count;
  }
};

TEST(SkeletonSettle, OfTwoSetsThatContradictEachOtherNeitherCountsUnlessOneIsFarLarger) {
  SideBySide two;
  auto& skeleton = two.skeleton;
  for (const std::uint32_t i : {0U, 2U, 4U}) two.meet(i, i, 0.0);
  two.meet(1, 5, 4.0);
  ASSERT_TRUE(skeleton.settle(kNever));
  EXPECT_TRUE(two.together()) << "one that contradicts is just wrong";
  two.meet(3, 7, 4.0);
  ASSERT_TRUE(skeleton.settle(kNever));
  EXPECT_FALSE(two.together());
  EXPECT_EQ(two.torn(), 5);
  two.meet(6, 6, 0.0);
  EXPECT_FALSE(two.together()) << "no jump to and fro before all are judged anew";
  ASSERT_TRUE(skeleton.settle(kNever));
  EXPECT_FALSE(two.together());
  for (const std::uint32_t i : {1U, 3U, 8U}) two.meet(i, i, 0.0);
  ASSERT_TRUE(skeleton.settle(kNever));
  EXPECT_TRUE(two.together()) << "seven against two";
  EXPECT_EQ(two.torn(), 0);
  ASSERT_NE(skeleton.pose(key(2, 0)), nullptr);
  EXPECT_NEAR(skeleton.pose(key(2, 0))->t.x(), 0.0, 1e-6);
}

TEST(SkeletonSettle, AHandDecidesBetweenTwoSets) {
  SideBySide two;
  auto& skeleton = two.skeleton;
  two.meet_both_ways();
  ASSERT_TRUE(skeleton.settle(kNever));
  EXPECT_FALSE(two.together());
  for (const std::uint32_t i : {0U, 2U})
    EXPECT_EQ(skeleton.decide(key(1, i), key(2, i), false, kNever), 1);
  ASSERT_TRUE(skeleton.settle(kNever));
  EXPECT_TRUE(two.together());
  EXPECT_EQ(two.torn(), 0);
  EXPECT_NEAR(skeleton.pose(key(2, 0))->t.x(), 4.0, 1e-6);
}

TEST(SkeletonSettle, AThirdAgentDecidesBetweenTwoSets) {
  SideBySide two;
  auto& skeleton = two.skeleton;
  two.meet_both_ways();
  skeleton.add(delta(key(3, 0), key(3, 1), 1.0), kNever);
  ASSERT_TRUE(skeleton.settle(kNever));
  EXPECT_FALSE(two.together());
  EXPECT_EQ(two.torn(), 4);
  for (const std::uint16_t who : {std::uint16_t{1}, std::uint16_t{2}})
    for (const std::uint32_t i : {0U, 1U})
      skeleton.add(closure(key(who, i), key(3, i), who == 2 ? -4.0 : 0.0), kNever);
  ASSERT_TRUE(skeleton.settle(kNever));
  EXPECT_TRUE(two.together());
  EXPECT_EQ(two.torn(), 0);
  EXPECT_NEAR(skeleton.pose(key(2, 0))->t.x(), 4.0, 1e-6);
}

TEST(SkeletonRoom, AFullGraphGoesOnAndKeepsTheNewest) {
  Arena arena;
  Skeleton skeleton{{.max_nodes = 20, .max_factors = 60}, arena};
  for (std::uint32_t i = 0; i < 200; ++i)
    EXPECT_EQ(skeleton.add(delta(key(1, i), key(1, i + 1), 1.0), kNever), Added::kLinked) << i;
  EXPECT_LE(skeleton.node_count(), 20);
  ASSERT_NE(skeleton.pose(key(1, 200)), nullptr);
  EXPECT_NEAR(skeleton.pose(key(1, 200))->t.x(), 200.0, 1e-6);
  EXPECT_NE(skeleton.pose(key(1, 0)), nullptr) << "the gauge stays";
  EXPECT_GE(skeleton.counters().condensed, 180u);
  Matrix6d covariance;
  ASSERT_TRUE(skeleton.covariance(key(1, 0), key(1, 200), covariance));
  EXPECT_NEAR(covariance(0, 0), 200 * 1e-4, 1e-5) << "a chain's contraction changes nothing";
  // A closure to a maplet that was taken out is told from the one that stands for it.
  std::uint32_t gone = 199;
  while (skeleton.pose(key(1, gone)) != nullptr) --gone;
  const auto standing = skeleton.standing(key(1, gone));
  ASSERT_TRUE(standing) << "where it was is still known";
  EXPECT_EQ(standing->gauge, key(1, 0));
  EXPECT_NEAR(standing->T_world_maplet.t.x(), gone, 1e-6);
  EXPECT_FALSE(skeleton.standing(key(2, 0)));
  EXPECT_EQ(skeleton.add(closure(key(1, gone), key(1, 200), 200.0 - gone), kNever), Added::kLinked);
}

TEST(SkeletonSights, WaitForTheirMapletAndPlaceBeacons) {
  Arena arena;
  Skeleton skeleton{{.max_nodes = 64, .max_factors = 256}, arena};
  const Eigen::Vector3d beacon{4.0, 5.0, 2.0};
  Se3 pose;
  std::vector<Se3> path;
  for (std::uint32_t i = 0; i < 30; ++i) {
    path.push_back(pose);
    const DeltaPose d = delta(key(1, i), key(1, i + 1), 0.7, 0.1 * (i % 3), 0.35);
    DeltaPose tilted = d;
    tilted.T_a_b.se3.t.z() = 0.3 * std::sin(0.7 * i);
    pose = pose * tilted.T_a_b.se3;
    Sight sight;
    sight.a = key(1, i);
    sight.b = key(1, 0);
    sight.point = true;
    sight.range_m = (beacon - path.back().t).norm();
    sight.range_sigma_m = 0.02;
    EXPECT_EQ(skeleton.add(sight, kNever), i == 0 ? Added::kWaiting : Added::kLinked);
    skeleton.add(tilted, kNever);
  }
  for (int k = 0; k < 200; ++k) skeleton.update(kNever);
  const Se3* found = skeleton.point(key(1, 0));
  ASSERT_NE(found, nullptr);
  EXPECT_LT((found->t - beacon).norm(), 0.05);
  Sight bad;
  bad.a = key(1, 0);
  bad.b = key(1, 3);
  bad.range_m = -1.0;
  EXPECT_EQ(skeleton.add(bad, kNever), Added::kBadMeasurement);
  bad.range_m = 1.0;
  bad.range_sigma_m = 0.1;
  bad.b = key(9, 9);
  for (int k = 0; k < 100; ++k) EXPECT_EQ(skeleton.add(bad, kNever), Added::kWaiting);
  EXPECT_EQ(skeleton.counters().waiting_dropped, 100u - 64u);
}

TEST(ConsistentSet, FindsTheLargestThatAgrees) {
  Arena arena;
  ConsistentSet set{100, arena};
  set.clear(10);
  for (const auto& [i, j] : {std::pair{0, 1}, {2, 3}, {3, 4}, {2, 4}, {4, 5}, {5, 6}})
    set.agree(i, j);
  std::array<bool, 100> member{};
  EXPECT_EQ(set.find(member), 3);
  EXPECT_TRUE(member[2] && member[3] && member[4]);
  EXPECT_FALSE(member[0] || member[1] || member[5] || member[6]);
}

}  // namespace
}  // namespace maplet
