// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/condenser.hpp"

#include <gtest/gtest.h>

namespace maplet {
namespace {

/// A chain of poses, one of which sees many points.
struct Chain {
  static constexpr int kPoses = 20;
  static constexpr int kPoints = 60;
  Arena arena;
  PoseGraph<PlanarSpace> graph;
  Marginals<PlanarSpace> marginals;
  Condenser<PlanarSpace> condenser;

  explicit Chain(int max_factors)
      : graph{{kPoses + kPoints, max_factors, 4000}, arena},
        marginals{graph.graph(), graph.elimination(), arena},
        condenser{graph, marginals, arena} {
    const Eigen::Matrix3d information = Eigen::Matrix3d::Identity() * 1e4;
    for (std::uint64_t i = 0; i < kPoses; ++i) graph.add_node({}, {0, i});
    for (int i = 0; i + 1 < kPoses; ++i)
      graph.add_between(i, i + 1, Se2::from(1.0, 0.0, 0.0), information);
    for (int k = 0; k < kPoints; ++k) {
      const Eigen::Vector2d at{1.0, 0.1 * k};
      const Se2 z = measure::make_position(at);
      const int point = graph.add_point(10, z);
      Eigen::Matrix3d seen = Eigen::Matrix3d::Zero();
      seen.diagonal().head<2>().setConstant(1e4);
      graph.add_sight(FactorKind::kPosition, 10, point, z, seen);
    }
    graph.update(Deadline::never());
  }
};

TEST(Condenser, WhatTakesThePlaceOfFactorsHasRoomBesideThem) {
  // 79 factors; with room for 30 more the pose that sees 60 points stays.
  Chain chain{Chain::kPoses - 1 + Chain::kPoints + 30};
  const auto& g = chain.graph.graph();
  for (int round = 0; round < 6; ++round) {
    ASSERT_TRUE(chain.condenser.make_room(3, 1));
    EXPECT_LE(g.factor_count(), g.max_factors());
    chain.condenser.finish();
    for (int k = 0; k < 3; ++k) chain.graph.add_point();
    chain.graph.update(Deadline::never());
  }
  EXPECT_FALSE(chain.condenser.make_room(3, 1));  // the gauge and that pose are left
  EXPECT_LE(g.factor_count(), g.max_factors());
  chain.condenser.finish();
  EXPECT_TRUE(g.node(10).used && !g.node(10).retired);
}

TEST(Condenser, AFewFactorsToSpareAreEnough) {
  // Fewer than a node may have neighbours.
  Chain chain{Chain::kPoses - 1 + Chain::kPoints + 6};
  const auto& g = chain.graph.graph();
  ASSERT_TRUE(chain.condenser.make_room(2, 1));
  EXPECT_LE(g.factor_count(), g.max_factors());
}

}  // namespace
}  // namespace maplet
