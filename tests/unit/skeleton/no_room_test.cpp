// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// More paths that cross than the factor has room for: a worse estimate, the same for all, never
// nonsense.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <vector>

#include "core/skeleton/skeleton.hpp"

namespace maplet {
namespace {

constexpr int kAgents = 12;
constexpr int kMaplets = 30;
constexpr double kBlock_m = 5.0;
constexpr double kSigma_m = 0.02;

MapletKey key(int agent, int id) {
  return {static_cast<std::uint16_t>(agent + 1), 3, static_cast<std::uint32_t>(id)};
}

/// Agents that walk at random over one square, and see each other's maplets wherever they cross.
struct Crowd {
  std::map<MapletKey, Eigen::Vector3d> truth;
  std::vector<DeltaPose> records;

  explicit Crowd(unsigned seed) {
    std::mt19937 random{seed};
    std::normal_distribution<double> noise{0.0, kSigma_m};
    std::uniform_int_distribution<int> turn{0, 3};
    const auto tell = [&](DeltaPose::Kind kind, const MapletKey& a, const MapletKey& b) {
      DeltaPose d;
      d.kind = kind;
      d.a = a;
      d.b = b;
      d.T_a_b.se3.t = truth[b] - truth[a];
      for (int i = 0; i < 3; ++i) d.T_a_b.se3.t[i] += noise(random);
      Vector6d turned = Vector6d::Zero();
      for (int i = 3; i < 6; ++i) turned[i] = 0.1 * noise(random);
      d.T_a_b.se3.q = Se3::exp(turned).q;
      d.covariance = kSigma_m * kSigma_m * Matrix6d::Identity();
      d.covariance.bottomRightCorner<3, 3>() *= 0.01;
      records.push_back(d);
    };
    for (int agent = 0; agent < kAgents; ++agent) {
      Eigen::Vector3d at{0.5 * agent, 0.0, 0.0};
      for (int id = 0; id < kMaplets; ++id) {
        truth[key(agent, id)] = at;
        if (id > 0) tell(DeltaPose::Kind::kConsecutive, key(agent, id - 1), key(agent, id));
        const int way = turn(random);
        at[way % 2] += way < 2 ? 1.0 : -1.0;
        for (int i = 0; i < 2; ++i) at[i] = std::clamp(at[i], -kBlock_m, kBlock_m);
      }
    }
    for (const auto& [a, at_a] : truth)
      for (const auto& [b, at_b] : truth)
        if (a.agent < b.agent && (at_a - at_b).norm() < 0.6 && random() % 4 == 0)
          tell(DeltaPose::Kind::kClosure, a, b);
  }
};

double rms_of(const Skeleton& skeleton, const Crowd& crowd) {
  double sum = 0.0;
  for (int i = 0; i < skeleton.node_count(); ++i) {
    const auto node = skeleton.node(i);
    sum += (node.T_world_maplet.t - crowd.truth.at(node.key) + crowd.truth.at(node.gauge))
               .squaredNorm();
  }
  return std::sqrt(sum / skeleton.node_count());
}

TEST(SkeletonWithoutRoom, SettlesOnTheSameForAllAndNotFarOff) {
  Crowd crowd{5};
  const int closures = static_cast<int>(crowd.records.size()) - kAgents * (kMaplets - 1);
  ASSERT_GT(closures, 150);
  SkeletonConfig roomy{.max_nodes = kAgents * kMaplets,
                       .max_factors = static_cast<int>(crowd.records.size()),
                       .blocks_per_node = 60,
                       .condense = false};
  Arena arena;
  Skeleton whole{roomy, arena};
  for (const DeltaPose& d : crowd.records) whole.add(d, Deadline::never());
  ASSERT_TRUE(whole.settle(Deadline::never()));
  ASSERT_EQ(whole.counters().overflows, 0u);
  const double best = rms_of(whole, crowd);

  SkeletonConfig tight = roomy;
  tight.blocks_per_node = 4;
  std::map<MapletKey, Eigen::Vector3d> places;
  std::mt19937 random{8};
  for (int round = 0; round < 3; ++round) {
    Arena small;
    Skeleton skeleton{tight, small};
    std::shuffle(crowd.records.begin(), crowd.records.end(), random);
    for (const DeltaPose& d : crowd.records) skeleton.add(d, Deadline::never());
    ASSERT_TRUE(skeleton.settle(Deadline::never()));
    EXPECT_GT(skeleton.counters().overflows, 0u);
    EXPECT_LT(rms_of(skeleton, crowd), 3.0 * best + 0.05);
    int out = 0;
    for (int i = 0; i < skeleton.factor_count(); ++i) {
      const auto factor = skeleton.factor(i);
      const bool no_room = factor.verdict == ClosureState::kNoRoom;
      EXPECT_EQ(factor.weight, no_room ? 0.0 : 1.0);
      out += no_room ? 1 : 0;
      EXPECT_NE(factor.verdict, ClosureState::kRejected) << "there are no wrong ones";
    }
    EXPECT_GT(out, 0);
    EXPECT_LT(out, closures);
    for (int i = 0; i < skeleton.node_count(); ++i) {
      const auto node = skeleton.node(i);
      const auto [place, first] = places.try_emplace(node.key, node.T_world_maplet.t);
      EXPECT_LT((place->second - node.T_world_maplet.t).norm(), 1e-8) << node.key.id;
    }
  }
}

}  // namespace
}  // namespace maplet
