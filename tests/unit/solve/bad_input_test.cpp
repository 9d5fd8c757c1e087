// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Bad input: defined, counted, said.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/solve/city.hpp"
#include "tools/solve/run.hpp"

namespace maplet::graphs {
namespace {

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

TEST(SolveBadInput, WhatIsLeftOutIsNamed) {
  GraphFile graph;
  graph.planar = true;
  graph.edges = {planar_edge(0, 1, 1.0, 0.0, 0.0), planar_edge(1, 2, 1e300, 0.0, 0.0),
                 planar_edge(1, 2, 1.0, 0.0, 0.0, 1e160), planar_edge(2, 2, 1.0, 0.0, 0.0)};
  const SolveOutcome out = solve(graph, {});
  EXPECT_EQ(out.accepted, 1u);
  ASSERT_EQ(out.named_bad_edges.size(), 3u);
  EXPECT_EQ(out.named_bad_edges[0].edge, 1);
  EXPECT_STREQ(out.named_bad_edges[0].why, "it is longer than 1e15 m");
  EXPECT_STREQ(out.named_bad_edges[1].why, "its information is beyond 1e24");
  EXPECT_STREQ(out.named_bad_edges[2].why, "it leads from a pose to itself");
  EXPECT_EQ(out.damped_pivots, 0u);
}

TEST(SolveBadInput, AVertexWithoutEdgesStaysWhereItIs) {
  GraphFile graph;
  graph.planar = true;
  graph.vertices.push_back({7, {Eigen::Quaterniond::Identity(), {3.0, 4.0, 0.0}}});
  const SolveOutcome out = solve(graph, {});
  ASSERT_EQ(out.solution.vertices.size(), 1u);
  EXPECT_EQ(out.solution.vertices[0].pose.t.x(), 3.0);
  EXPECT_EQ(out.groups, 1);
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
