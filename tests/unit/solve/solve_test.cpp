// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tools/solve/run.hpp"

namespace maplet::graphs {
namespace {

Edge planar_edge(std::uint64_t a, std::uint64_t b, double x, double y, double theta,
                 double information = 100.0) {
  Edge e;
  e.a = a;
  e.b = b;
  e.z.t = {x, y, 0.0};
  e.z.q = Eigen::Quaterniond{std::cos(0.5 * theta), 0.0, 0.0, std::sin(0.5 * theta)};
  e.information(0, 0) = e.information(1, 1) = e.information(5, 5) = information;
  return e;
}

/// A walk along the streets of a city of square blocks, with a closure wherever it comes by a place
/// again.
GraphFile city(int poses, int size, double sigma, unsigned seed) {
  GraphFile graph;
  graph.planar = true;
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, sigma};
  struct At {
    int x, y, heading;
  };
  std::vector<At> walk{{0, 0, 0}};
  std::map<std::pair<int, int>, std::vector<int>> been;
  const std::array<std::pair<int, int>, 4> ahead{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};
  const auto measure = [&](int a, int b) {
    const double turn = walk[a].heading * M_PI / 2.0;
    const double dx = walk[b].x - walk[a].x;
    const double dy = walk[b].y - walk[a].y;
    graph.edges.push_back(planar_edge(
        a, b, std::cos(turn) * dx + std::sin(turn) * dy + noise(random),
        std::cos(turn) * dy - std::sin(turn) * dx + noise(random),
        (walk[b].heading - walk[a].heading) * M_PI / 2.0 + noise(random), 1.0 / (sigma * sigma)));
  };
  been[{0, 0}].push_back(0);
  for (int i = 1; i < poses; ++i) {
    At at = walk.back();
    for (int tries = 0; tries < 20; ++tries) {
      const int turn = at.x % 5 == 0 && at.y % 5 == 0 ? static_cast<int>(random() % 4) : 0;
      const int heading = (at.heading + turn) % 4;
      const int x = at.x + ahead[heading].first;
      const int y = at.y + ahead[heading].second;
      if (std::abs(x) > size || std::abs(y) > size) {
        at.heading = (at.heading + 2) % 4;
        continue;
      }
      at = {x, y, heading};
      break;
    }
    walk.push_back(at);
    measure(i - 1, i);
    auto& here = been[{at.x, at.y}];
    if (!here.empty() && i - here.back() > 20) measure(here[random() % here.size()], i);
    here.push_back(i);
    graph.truth[static_cast<std::uint64_t>(i)].t = {static_cast<double>(at.x),
                                                    static_cast<double>(at.y), 0.0};
  }
  return graph;
}

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

// Bad input: defined, counted, said.

TEST(SolveBadInput, ADisconnectedGraphStandsSideBySide) {
  GraphFile graph;
  graph.planar = true;
  graph.edges = {planar_edge(0, 1, 1.0, 0.0, 0.0), planar_edge(10, 11, 2.0, 0.0, 0.0)};
  const SolveOutcome out = solve(graph, {});
  EXPECT_EQ(out.groups, 2);
  EXPECT_LT(out.chi2, 1e-12);
}

TEST(SolveBadInput, DuplicateIdsAndEdgesCountTwice) {
  GraphFile graph;
  graph.planar = true;
  graph.vertices = {{0, {}}, {0, {}}, {1, {}}};
  graph.edges = {planar_edge(0, 1, 1.0, 0.0, 0.0), planar_edge(0, 1, 2.0, 0.0, 0.0)};
  const SolveOutcome out = solve(graph, {});
  EXPECT_EQ(out.solution.vertices.size(), 2u);
  EXPECT_EQ(out.accepted, 2u);
  EXPECT_NEAR(out.chi2, 2.0 * 100.0 * 0.25, 1e-6);
}

TEST(SolveBadInput, InformationThatIsNoneIsCountedAndLeftOut) {
  GraphFile graph;
  graph.planar = true;
  graph.edges = {planar_edge(0, 1, 1.0, 0.0, 0.0), planar_edge(1, 2, 1.0, 0.0, 0.0),
                 planar_edge(1, 2, 1.0, 0.0, 0.0, -1.0), planar_edge(1, 2, 1.0, 0.0, 0.0, NAN),
                 planar_edge(2, 2, 1.0, 0.0, 0.0)};
  const SolveOutcome out = solve(graph, {});
  EXPECT_EQ(out.bad_edges, 3u);
  EXPECT_EQ(out.accepted, 2u);
}

TEST(SolveBadInput, AGraphOfNothingHasNoLength) {
  GraphFile graph;
  graph.planar = true;
  EXPECT_EQ(solve(graph, {}).solution.vertices.size(), 0u);
  for (std::uint64_t i = 0; i < 10; ++i)
    graph.edges.push_back(planar_edge(i, i + 1, 0.0, 0.0, 0.0));
  graph.edges.push_back(planar_edge(0, 10, 0.0, 0.0, 0.0));
  const SolveOutcome out = solve(graph, {});
  EXPECT_LT(out.chi2, 1e-12);
  EXPECT_EQ(out.solution.vertices.size(), 11u);
}

TEST(SolveBadInput, ContradictoryClosuresStayFinite) {
  GraphFile graph;
  graph.planar = true;
  for (std::uint64_t i = 0; i < 50; ++i)
    graph.edges.push_back(planar_edge(i, i + 1, 1.0, 0.0, 0.1));
  for (std::uint64_t i = 0; i < 40; ++i) {
    graph.edges.push_back(planar_edge(i, i + 10, 100.0, 0.0, 3.0, 1e4));
    graph.edges.push_back(planar_edge(i, i + 10, -100.0, 7.0, -3.0, 1e4));
  }
  const SolveOutcome out = solve(graph, {});
  EXPECT_TRUE(std::isfinite(out.chi2));
  for (const Vertex& v : out.solution.vertices) EXPECT_LT(v.pose.t.norm(), 1e4);
}

TEST(SolveBadInput, ABillionMetresIsADistance) {
  GraphFile graph;
  graph.planar = true;
  graph.edges = {planar_edge(0, 1, 1e9, 0.0, 0.0), planar_edge(1, 2, 1e9, 1e9, 1.0),
                 planar_edge(2, 0, 3.0, 0.0, 0.0)};
  const SolveOutcome out = solve(graph, {});
  EXPECT_TRUE(std::isfinite(out.chi2));
  for (const Vertex& v : out.solution.vertices) EXPECT_TRUE(v.pose.t.allFinite());
}

}  // namespace
}  // namespace maplet::graphs
