// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <random>

#include "tests/unit/solve/city.hpp"
#include "tools/solve/run.hpp"

namespace maplet::graphs {
namespace {

/// Closures between random places, with the transform of a real one.
std::size_t add_false_closures(GraphFile& graph, double share, unsigned seed) {
  std::mt19937 random{seed};
  std::vector<Edge> real;
  std::copy_if(graph.edges.begin(), graph.edges.end(), std::back_inserter(real),
               [](const Edge& e) { return e.b - e.a > 1; });
  const std::size_t poses = graph.truth.size();
  const auto wanted = static_cast<std::size_t>(share * static_cast<double>(real.size()));
  for (std::size_t k = 0; k < wanted; ++k) {
    Edge e = real[random() % real.size()];
    do {
      e.a = random() % poses;
      e.b = random() % poses;
    } while (e.a + 1 >= e.b || (graph.truth[e.a].t - graph.truth[e.b].t).norm() < 3.0);
    e.line = 1;
    graph.edges.push_back(e);
  }
  return real.size();
}

class SolveRobust : public testing::TestWithParam<bool> {};

TEST_P(SolveRobust, FalseClosuresAreLeftOutAndTrueOnesStay) {
  GraphFile graph = city(800, 8, 0.03, 5);
  SolveOptions options;
  const double clean = solve(graph, options).accuracy->ate_rms_m;
  const std::size_t real = add_false_closures(graph, 0.4, 11);
  options.robust = true;
  options.batch = GetParam();
  const SolveOutcome out = solve(graph, options);
  const auto is_false = [](const Edge& e) { return e.line == 1; };
  const auto found = std::count_if(out.rejected.begin(), out.rejected.end(), is_false);
  const auto there = std::count_if(graph.edges.begin(), graph.edges.end(), is_false);
  EXPECT_EQ(found, there);
  EXPECT_LE(out.rejected.size() - static_cast<std::size_t>(found), real / 100);
  EXPECT_LT(out.accuracy->ate_rms_m, 1.05 * clean);
  EXPECT_EQ(out.heap_allocations, 0u);
}

TEST_P(SolveRobust, ASecondEdgeToTheNextPoseIsAClosure) {
  GraphFile graph = city(300, 8, 0.03, 5);
  const auto step = std::find_if(graph.edges.begin(), graph.edges.end(),
                                 [](const Edge& e) { return e.a == 150 && e.b == 151; });
  ASSERT_NE(step, graph.edges.end());
  Edge wrong = *step;
  wrong.z.t.x() += 5.0;
  wrong.line = 1;
  graph.edges.push_back(wrong);
  SolveOptions options;
  options.robust = true;
  options.batch = GetParam();
  const SolveOutcome out = solve(graph, options);
  ASSERT_EQ(out.rejected.size(), 1u);
  EXPECT_EQ(out.rejected.front().line, 1);
}

TEST_P(SolveRobust, ClosuresOfASmallMapThatNothingSpeaksAgainstAreKept) {
  GraphFile graph;
  graph.planar = true;
  graph.edges = {planar_edge(0, 1, 1.0, 0.0, 0.0),  planar_edge(1, 2, 0.0, 1.0, 0.0),
                 planar_edge(2, 3, -1.0, 0.0, 0.0), planar_edge(0, 3, 0.0, 1.0, 0.0),
                 planar_edge(0, 2, 1.0, 1.0, 0.0),  planar_edge(3, 9, 1.0, 1.0, 0.0)};
  SolveOptions options;
  options.robust = true;
  options.batch = GetParam();
  const SolveOutcome out = solve(graph, options);
  EXPECT_TRUE(out.rejected.empty());
  EXPECT_EQ(out.groups, 1) << "a pose's only link bends nothing";
}

TEST_P(SolveRobust, AClosureThatStandsAloneIsKeptAmongManyFalseOnes) {
  constexpr int kSide = 3;
  GraphFile graph = city(800, 8, 0.03, 5);
  std::mt19937 random{9};
  std::normal_distribution<double> noise{0.0, 0.03};
  std::uint64_t last = 799;
  for (int side = 0; side < 4; ++side)  // around a block where nobody else has been
    for (int k = 0; k < kSide; ++k, ++last) {
      const double turn = k == 0 ? M_PI / 2.0 : 0.0;
      graph.edges.push_back(planar_edge(last, last + 1, std::cos(turn) + noise(random),
                                        std::sin(turn) + noise(random), turn + noise(random),
                                        1.0 / (0.03 * 0.03)));
      Se3 step;
      step.t = {std::cos(turn), std::sin(turn), 0.0};
      step.q = {std::cos(0.5 * turn), 0.0, 0.0, std::sin(0.5 * turn)};
      graph.truth[last + 1] = graph.truth[last] * step;
    }
  (void)add_false_closures(graph, 0.5, 11);
  graph.edges.push_back(planar_edge(799, last, 0.0, 0.0, 0.0, 1.0 / (0.03 * 0.03)));
  graph.edges.back().line = 2;
  SolveOptions options;
  options.robust = true;
  options.batch = GetParam();
  const SolveOutcome out = solve(graph, options);
  const auto is_false = [](const Edge& e) { return e.line == 1; };
  EXPECT_TRUE(std::none_of(out.rejected.begin(), out.rejected.end(),
                           [](const Edge& e) { return e.line == 2; }));
  EXPECT_EQ(std::count_if(out.rejected.begin(), out.rejected.end(), is_false),
            std::count_if(graph.edges.begin(), graph.edges.end(), is_false));
}

TEST_P(SolveRobust, FalseClosuresThatBearEachOtherOutEndInTime) {
  GraphFile graph = city(800, 8, 0.03, 5);
  std::mt19937 random{3};
  for (int group = 0; group < 40; ++group) {
    const std::uint64_t a = random() % 390;
    const std::uint64_t b = 400 + random() % 390;
    for (std::uint64_t k = 0; k < 5; ++k) {
      Edge e = planar_edge(a + k, b + k, 5.0, 3.0, 0.3);
      e.z = e.z * graph.truth[b].inverse() * graph.truth[b + k];
      e.z = graph.truth[a + k].inverse() * graph.truth[a] * e.z;
      e.line = 1;
      graph.edges.push_back(e);
    }
  }
  SolveOptions options;
  options.robust = true;
  options.batch = GetParam();
  EXPECT_LT(solve(graph, options).total_ms, 20'000.0);
}

INSTANTIATE_TEST_SUITE_P(Both, SolveRobust, testing::Bool(),
                         [](const auto& kind) { return kind.param ? "Batch" : "Incremental"; });

}  // namespace
}  // namespace maplet::graphs
