// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/measure.hpp"

#include <gtest/gtest.h>

#include <random>

#include "core/skeleton/pose_graph.hpp"

namespace maplet {
namespace {

constexpr std::array kSights{FactorKind::kRange, FactorKind::kBearing, FactorKind::kRangeBearing,
                             FactorKind::kPosition};

template <class Space>
class MeasureTest : public testing::Test {
 protected:
  using Pose = typename Space::Pose;
  using Tangent = typename Space::Tangent;
  using Block = typename Space::Block;
  using Point = measure::Point<Space>;

  Tangent random_tangent(double scale) {
    Tangent xi;
    for (int i = 0; i < Space::kDim; ++i) xi[i] = scale * normal_(random_);
    return xi;
  }
  Pose random_pose(double scale = 1.0) { return Space::retract({}, random_tangent(scale)); }

  static Pose seen(FactorKind kind, const Pose& rel) {
    if (kind == FactorKind::kPosition) return measure::make_position(measure::position(rel));
    if constexpr (Space::kDim == 3) {
      return measure::make_sight(std::hypot(rel.x, rel.y), std::atan2(rel.y, rel.x), Space{});
    } else {
      return measure::make_sight(rel.t.norm(), rel.t, Space{});
    }
  }
  /// Information of the rows that the kind has, of standard deviation `sigma`.
  static Block information(FactorKind kind, double sigma) {
    constexpr int kDirections = Space::kDim == 3 ? 1 : 3;
    Tangent rows = Tangent::Zero();
    if (kind == FactorKind::kPosition) rows.template head<Space::kPoint>().setOnes();
    if (kind == FactorKind::kRange || kind == FactorKind::kRangeBearing) rows[0] = 1.0;
    if (kind == FactorKind::kBearing || kind == FactorKind::kRangeBearing)
      rows.template segment<kDirections>(1).setOnes();
    return (rows / (sigma * sigma)).asDiagonal();
  }

  std::mt19937 random_{11};
  std::normal_distribution<double> normal_;
};

using Spaces = testing::Types<PlanarSpace, SpatialSpace>;
TYPED_TEST_SUITE(MeasureTest, Spaces);

TYPED_TEST(MeasureTest, WhatIsSeenHasNoError) {
  using Space = TypeParam;
  for (const FactorKind kind : kSights) {
    Factor<Space> f;
    f.kind = kind;
    const auto rel = this->random_pose(2.0);
    f.z = this->seen(kind, rel);
    EXPECT_LT(measure::error(f, rel).norm(), 1e-12);
    EXPECT_GT(measure::error(f, this->random_pose(2.0)).norm(), 1e-3);
  }
}

TYPED_TEST(MeasureTest, JacobiansAreThoseOfDifferences) {
  using Space = TypeParam;
  constexpr double kStep = 1e-6;
  for (const FactorKind kind : kSights) {
    for (int round = 0; round < 20; ++round) {
      Factor<Space> f;
      f.kind = kind;
      const auto a = this->random_pose();
      const auto b = this->random_pose();
      f.z = this->seen(kind, this->random_pose());
      const auto error = [&](const auto& at_a, const auto& at_b) {
        return measure::error(f, Space::between(at_a, at_b));
      };
      const auto rel = Space::between(a, b);
      typename Space::Block by_a, by_b, numeric_a, numeric_b;
      measure::jacobians(f, rel, error(a, b), by_a, by_b);
      for (int i = 0; i < Space::kDim; ++i) {
        typename Space::Tangent xi = Space::Tangent::Zero();
        xi[i] = kStep;
        const typename Space::Tangent back = -xi;
        numeric_a.col(i) =
            (error(Space::retract(a, xi), b) - error(Space::retract(a, back), b)) / (2.0 * kStep);
        numeric_b.col(i) =
            (error(a, Space::retract(b, xi)) - error(a, Space::retract(b, back))) / (2.0 * kStep);
      }
      const double scale = 1.0 + by_a.norm() + by_b.norm();
      EXPECT_LT((by_a - numeric_a).norm() / scale, 1e-7);
      EXPECT_LT((by_b - numeric_b).norm() / scale, 1e-7);
      typename Space::Tangent pulled_a, pulled_b;
      const typename Space::Tangent v = this->random_tangent(1.0);
      measure::pull_back(f, rel, error(a, b), v, pulled_a, pulled_b);
      EXPECT_LT((pulled_a - by_a.transpose() * v).norm() / scale, 1e-12);
      EXPECT_LT(
          (measure::push_forward(f, rel, error(a, b), v, v) - (by_a + by_b) * v).norm() / scale,
          1e-12);
    }
  }
}

/// A walk with points beside it, each seen from three poses.
TYPED_TEST(MeasureTest, PointsAreFoundFromWhatIsSeenOfThem) {
  using Space = TypeParam;
  for (const FactorKind kind : {FactorKind::kRange, FactorKind::kBearing, FactorKind::kRangeBearing,
                                FactorKind::kPosition}) {
    Arena arena;
    PoseGraph<Space> graph{{60, 200, 4000}, arena};
    std::vector<typename Space::Pose> truth{{}};
    graph.add_node({}, {0, 0});
    for (int i = 1; i < 20; ++i) {
      const auto step = this->random_pose(0.5);
      truth.push_back(Space::compose(truth.back(), step));
      graph.add_node({}, {0, static_cast<std::uint64_t>(i)});
      graph.add_between(i - 1, i, step, 1e6 * Space::Block::Identity());
      graph.update(Deadline::never());
    }
    for (int k = 0; k < 4; ++k) {
      const auto point = Space::compose(truth[5 * k], this->random_pose(2.0));
      const auto start =
          Space::compose(Space::between(truth[5 * k], point), this->random_pose(0.1));
      const int node = graph.add_point(5 * k, start);
      for (int i = 0; i < 20; i += 2)
        graph.add_sight(kind, i, node, this->seen(kind, Space::between(truth[i], point)),
                        this->information(kind, 0.01));
      for (int n = 0; n < 50; ++n) graph.update(Deadline::never());
      const auto& at = graph.graph().node(node).pose;
      EXPECT_LT((measure::position(at) - measure::position(point)).norm(), 1e-3)
          << "kind " << static_cast<int>(kind);
    }
    EXPECT_LT(graph.chi2(), 1e-3);
    EXPECT_EQ(graph.elimination().damped_pivots(), 0u);
  }
}

TYPED_TEST(MeasureTest, APriorHoldsItsGroupWhereItSays) {
  using Space = TypeParam;
  Arena arena;
  PoseGraph<Space> graph{{60, 200, 4000}, arena};
  const auto step = this->random_pose(0.5);
  const auto there = this->random_pose(3.0);
  for (std::uint64_t i = 0; i < 6; ++i) graph.add_node({}, {i < 3 ? 1u : 0u, i});
  for (const int i : {0, 1, 3, 4}) graph.add_between(i, i + 1, step, Space::Block::Identity());
  const int prior = graph.add_prior(2, there, Space::Block::Identity());
  graph.flush();
  const auto& nodes = graph.graph();
  EXPECT_LT(Space::error(there, nodes.node(2).pose).norm(), 1e-9);
  // Another group joins, although it is senior; its first node becomes the group's head.
  graph.add_between(2, 3, step, Space::Block::Identity());
  for (int n = 0; n < 20; ++n) graph.update(Deadline::never());
  EXPECT_LT(Space::error(there, nodes.node(2).pose).norm(), 1e-9);
  EXPECT_LT(Space::error(Space::compose(there, step), nodes.node(3).pose).norm(), 1e-9);
  EXPECT_EQ(graph.group(0), 3);
  // A second, contradicting one meets it half way.
  typename Space::Tangent off = Space::Tangent::Zero();
  off[0] = 0.1;
  graph.add_prior(2, Space::retract(there, off), Space::Block::Identity());
  for (int n = 0; n < 20; ++n) graph.update(Deadline::never());
  EXPECT_NEAR(graph.chi2(), 2.0 * 0.05 * 0.05, 1e-9);
  graph.set_weight(prior, 0.0);
  for (int n = 0; n < 20; ++n) graph.update(Deadline::never());
  EXPECT_NEAR(graph.chi2(), 0.0, 1e-9);
}

TYPED_TEST(MeasureTest, ASightBetweenGroupsWaits) {
  using Space = TypeParam;
  Arena arena;
  PoseGraph<Space> graph{{60, 200, 4000}, arena};
  for (std::uint64_t i = 0; i < 4; ++i) graph.add_node({}, {0, i});
  const auto step = this->random_pose(0.5);
  graph.add_between(0, 1, step, Space::Block::Identity());
  graph.add_between(2, 3, step, Space::Block::Identity());
  const int sight = graph.add_sight(FactorKind::kRange, 0, 3, this->seen(FactorKind::kRange, step),
                                    this->information(FactorKind::kRange, 0.1));
  graph.flush();
  EXPECT_NE(graph.group(0), graph.group(3));
  EXPECT_FALSE(graph.graph().factor(sight).state.active);
  graph.connect(1, 2, this->random_pose());
  graph.set_weight(sight, 1.0);
  graph.flush();
  EXPECT_EQ(graph.group(0), graph.group(3));
  EXPECT_TRUE(graph.graph().factor(sight).state.active);
}

}  // namespace
}  // namespace maplet
