// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/unit/solve/city.hpp"
#include "tools/solve/run.hpp"

namespace maplet::graphs {
namespace {

TEST(Solve, BeaconsOfWhichOnlyRangesAreKnownAreFound) {
  GraphFile graph;
  graph.planar = true;
  std::mt19937 random{5};
  std::normal_distribution<double> noise{0.0, 0.1};
  const std::array<Eigen::Vector2d, 3> beacons{{{5.0, 12.0}, {-8.0, 3.0}, {15.0, -9.0}}};
  double x = 0.0, y = 0.0, heading = 0.0;
  for (std::uint64_t i = 0; i < 300; ++i) {
    const auto id = symbol('A', i);
    graph.truth[id].t = {x, y, 0.0};
    if (i % 3 == 0) {
      const auto k = (i / 3) % 3;
      Edge e;
      e.kind = FactorKind::kRange;
      e.a = id;
      e.b = symbol('L', k);
      e.range_m = (beacons[k] - Eigen::Vector2d{x, y}).norm() + noise(random);
      e.information(0, 0) = 100.0;
      graph.points.insert(e.b);
      graph.truth[e.b].t = {beacons[k].x(), beacons[k].y(), 0.0};
      graph.edges.push_back(e);
    }
    const double turn = i < 40 ? 0.0 : 0.04;  // straight at first: left or right is not known
    graph.edges.push_back(planar_edge(id, id + 1, 0.3, 0.0, turn + 0.01 * noise(random), 1e4));
    x += 0.3 * std::cos(heading), y += 0.3 * std::sin(heading);
    heading += turn;
  }
  const SolveOutcome out = solve(graph, {});
  ASSERT_TRUE(out.accuracy);
  EXPECT_EQ(out.groups, 1);
  EXPECT_EQ(out.accuracy->points, 3u);
  EXPECT_LT(out.accuracy->ate_rms_m, 0.1);
  EXPECT_LT(out.accuracy->points_rms_m, 0.2);
  EXPECT_EQ(out.heap_allocations, 0u);
}

TEST(Solve, ABeaconSeenFromAStraightPathStaysApart) {
  GraphFile graph;
  graph.planar = true;
  for (std::uint64_t i = 0; i < 60; ++i) {
    graph.edges.push_back(planar_edge(symbol('A', i), symbol('A', i + 1), 0.3, 0.0, 0.0, 1e4));
    Edge e;
    e.kind = FactorKind::kRange;
    e.a = symbol('A', i);
    e.b = symbol('L', 0);
    e.range_m = std::hypot(0.3 * static_cast<double>(i) - 6.0, 4.0);
    e.information(0, 0) = 100.0;
    graph.points.insert(e.b);
    graph.edges.push_back(e);
  }
  const SolveOutcome out = solve(graph, {});
  EXPECT_EQ(out.groups, 2) << "left or right of the path: nothing tells";
}

/// Two robots that drive around and see how far the other is, nothing else.
TEST(Solve, RobotsThatOnlyRangeEachOtherFindTheirRelation) {
  GraphFile graph;
  graph.planar = true;
  std::mt19937 random{9};
  std::normal_distribution<double> noise{0.0, 0.05};
  std::array<Se2, 2> at{Se2::from(0.0, 0.0, 0.0), Se2::from(6.0, 4.0, 2.0)};
  for (std::uint64_t i = 0; i < 150; ++i) {
    for (int r = 0; r < 2; ++r) {
      const auto id = symbol(static_cast<char>('A' + r), i);
      graph.truth[id].t = {at[r].x, at[r].y, 0.0};
      const double turn = 0.15 * std::sin(0.05 * static_cast<double>(i) + r);
      const Se2 step = Se2::from(0.3, 0.0, turn);
      graph.edges.push_back(planar_edge(id, id + 1, 0.3, 0.0, turn, 1e5));
      if (r == 1 && i % 2 == 0) {
        Edge e;
        e.kind = FactorKind::kRange;
        e.a = symbol('A', i);
        e.b = id;
        e.range_m = std::hypot(at[1].x - graph.truth[e.a].t.x(), at[1].y - graph.truth[e.a].t.y()) +
                    noise(random);
        e.information(0, 0) = 400.0;
        graph.edges.push_back(e);
      }
      at[r] = PlanarSpace::compose(at[r], step);
    }
  }
  const SolveOutcome out = solve(graph, {});
  EXPECT_EQ(out.groups, 1);
  ASSERT_TRUE(out.accuracy);
  EXPECT_LT(out.accuracy->ate_rms_m, 0.1);
}

TEST(Solve, ASmallGraphStaysWithinItsNodesAndNearTheWholeOnesAnswer) {
  const GraphFile graph = city(1500, 10, 0.05, 3);
  SolveOptions options;
  const SolveOutcome whole = solve(graph, options);
  options.max_nodes = 150;
  const SolveOutcome small = solve(graph, options);
  EXPECT_LE(small.solution.vertices.size(), 150u);
  EXPECT_GE(small.solution.vertices.size(), 120u);
  EXPECT_GE(small.contracted, 1350u);
  EXPECT_LT(small.arena_bytes, whole.arena_bytes / 3);
  ASSERT_TRUE(whole.accuracy && small.accuracy);
  EXPECT_LT(small.accuracy->ate_rms_m, 2.0 * whole.accuracy->ate_rms_m);
  EXPECT_EQ(small.groups, 1);
  EXPECT_EQ(small.heap_allocations, 0u);
  EXPECT_EQ(small.overflows, 0u);
  for (const Vertex& v : small.solution.vertices) EXPECT_TRUE(v.pose.t.allFinite());
}

TEST(Solve, WhatIsLeftOfASmallGraphIsSolvedAtOnceWhenAsked) {
  const GraphFile graph = city(1500, 10, 0.05, 3);
  SolveOptions options;
  options.max_nodes = 150;
  const SolveOutcome incremental = solve(graph, options);
  options.batch = true;
  const SolveOutcome batch = solve(graph, options);
  EXPECT_LE(batch.solution.vertices.size(), 150u);
  EXPECT_LE(batch.chi2, incremental.chi2 * (1.0 + 1e-6));
}

TEST(Solve, AChainLosesNothingWhenItIsContracted) {
  GraphFile graph;
  graph.planar = true;
  for (std::uint64_t i = 0; i < 400; ++i)
    graph.edges.push_back(planar_edge(i, i + 1, 1.0, 0.0, 0.01));
  SolveOptions options;
  const SolveOutcome whole = solve(graph, options);
  options.max_nodes = 40;
  const SolveOutcome small = solve(graph, options);
  for (const Vertex& v : small.solution.vertices) {
    const auto same = std::find_if(whole.solution.vertices.begin(), whole.solution.vertices.end(),
                                   [&](const Vertex& w) { return w.id == v.id; });
    EXPECT_LT((same->pose.t - v.pose.t).norm(), 1e-6);
  }
}

// One pose sees more of the others than the graph has room for factors.
TEST(Solve, MoreEdgesAtOnceThanThereIsRoomForAreLostAndCounted) {
  GraphFile graph;
  graph.planar = true;
  for (std::uint64_t i = 0; i < 500; ++i)
    graph.edges.push_back(planar_edge(i, i + 1, 1.0, 0.0, 0.0));
  for (std::uint64_t i = 0; i < 450; ++i)
    graph.edges.push_back(planar_edge(i, 500, 500.0 - static_cast<double>(i), 0.0, 0.0));
  SolveOptions options;
  options.max_nodes = 16;
  const SolveOutcome out = solve(graph, options);
  EXPECT_LE(out.solution.vertices.size(), 16u);
  EXPECT_GT(out.lost_edges, 0u);
  EXPECT_LT(out.chi2, 1e-6);
}

TEST(Solve, TenThousandPosesReachTheBatchOptimum) {
  const GraphFile graph = city(10'000, 25, 0.03, 7);
  const SolveOutcome incremental = solve(graph, {});
  EXPECT_EQ(incremental.solution.vertices.size(), 10'000u);
  EXPECT_EQ(incremental.heap_allocations, 0u);
  GraphFile started = graph;
  started.vertices = incremental.solution.vertices;
  SolveOptions options;
  options.batch = true;
  const SolveOutcome batch = solve(started, options);
  EXPECT_LT(incremental.chi2, 1.001 * batch.chi2);
}

// Odometry alone would lead into a valley that no step leaves.
TEST(Solve, LargeRotationErrorsDoNotEndInABadValley) {
  GraphFile graph = city(1500, 6, 0.2, 3);
  const SolveOutcome out = solve(graph, {});
  GraphFile started = graph;
  for (const auto& [id, pose] : graph.truth) started.vertices.push_back({id, pose});
  SolveOptions options;
  options.batch = true;
  const SolveOutcome best = solve(started, options);
  EXPECT_LT(out.chi2, 1.001 * best.chi2);
  EXPECT_EQ(out.heap_allocations, 0u);
}

}  // namespace
}  // namespace maplet::graphs
