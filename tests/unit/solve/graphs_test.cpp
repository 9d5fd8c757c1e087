// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Public data sets against what is known of them (docs/benchmarks.md).
#include <gtest/gtest.h>

#include <map>
#include <random>
#include <vector>

#include "tests/support/recordings.hpp"
#include "tools/solve/run.hpp"

namespace maplet::graphs {
namespace {

struct Optimum {
  const char* name;
  double chi2;   ///< planar; else 0
  double f_log;  ///< spatial; else 0
};

class PublicGraph : public testing::TestWithParam<Optimum> {};

TEST_P(PublicGraph, EndsAtTheOptimum) {
  MAPLET_RECORDING(path, std::filesystem::path{"graphs"} / GetParam().name);
  GraphFile graph;
  read_graph(path, 0, graph);
  const SolveOutcome out = solve(graph, {});
  EXPECT_EQ(out.heap_allocations, 0u);
  EXPECT_EQ(out.overflows, 0u);
  if (GetParam().chi2 > 0.0) {
    EXPECT_LT(out.chi2, 1.001 * GetParam().chi2);
  }
  if (GetParam().f_log > 0.0) {
    EXPECT_LT(out.f_log, 1.001 * GetParam().f_log);
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, PublicGraph,
                         testing::Values(Optimum{"M3500.g2o", 146.07661, 0.0},
                                         Optimum{"intel.g2o", 45.00470, 0.0},
                                         Optimum{"CSAIL.g2o", 40.55513, 0.0},
                                         Optimum{"sphere2500.g2o", 0.0, 675.70096},
                                         Optimum{"parking-garage.g2o", 0.0, 0.634192}),
                         [](const auto& set) {
                           std::string name = set.param.name;
                           name.resize(name.find('.'));
                           std::erase(name, '-');
                           return name;
                         });

TEST(PublicRanges, Plaza2IsSolvedFromOdometryAndRanges) {
  MAPLET_RECORDING(path, "graphs/range/plaza2.pyfg");
  GraphFile graph;
  read_graph(path, 0, graph);
  const SolveOutcome out = solve(graph, {});
  ASSERT_TRUE(out.accuracy);
  EXPECT_EQ(out.accuracy->points, 4u);
  EXPECT_LT(out.accuracy->ate_rms_m, 1.0);
  EXPECT_EQ(out.groups, 1);
}

TEST(PublicRanges, FiveRobotsOfMrclamComeTogether) {
  MAPLET_RECORDING(path, "multirobot/mrclam6");
  GraphFile graph;
  read_graph(path, 0, graph);
  const SolveOutcome out = solve(graph, {});
  ASSERT_TRUE(out.accuracy);
  EXPECT_EQ(out.groups, 1);
  EXPECT_LT(out.accuracy->ate_rms_m, 0.2 * out.accuracy->odometry_ate_rms_m);
  EXPECT_LT(out.chi2, 35000.0) << "a step that went astray is taken back (34,636; else 35,500)";
}

// As many false closures as there are true ones, half of all: another closure's transform between
// two random poses. One that happens to be true is not false.
TEST(PublicGraphs, OfFalseClosuresNoneStaysAndOfTrueOnesNoneGoes) {
  MAPLET_RECORDING(path, "graphs/CSAIL.g2o");
  GraphFile graph;
  read_graph(path, 0, graph);
  const SolveOutcome clean = solve(graph, {});
  const std::vector<Vertex>& poses = clean.solution.vertices;
  std::map<std::uint64_t, Se3> at;
  for (const Vertex& v : poses) at[v.id] = v.pose;
  std::vector<Edge> closures;
  for (const Edge& e : graph.edges)
    if (e.b != e.a + 1) closures.push_back(e);
  std::mt19937 random{20};
  const auto any = [&](std::size_t count) { return random() % count; };
  const std::size_t all = 2 * closures.size();
  int line = 1'000'000;  // tells them apart
  for (std::size_t added = 0; added < all / 2;) {
    Edge lie = closures[any(closures.size())];
    lie.a = poses[any(poses.size())].id;
    lie.b = poses[any(poses.size())].id;
    const Vector6d e = (lie.z.inverse() * (at[lie.a].inverse() * at[lie.b])).log();
    if (lie.a == lie.b || e.dot(lie.information * e) < 11.345) continue;
    lie.line = line++;
    graph.edges.push_back(lie);
    ++added;
  }
  SolveOptions options;
  options.robust = true;
  const SolveOutcome out = solve(graph, options);
  std::size_t lies = 0;
  for (const Edge& e : out.rejected) lies += e.line >= 1'000'000 ? 1 : 0;
  EXPECT_EQ(lies, all / 2) << "none stays";
  EXPECT_EQ(out.rejected.size(), lies) << "no true one goes";
}

TEST(PublicGraphs, ATenthOfThePosesKeepsTheAccuracy) {
  MAPLET_RECORDING(path, "graphs/M3500.g2o");
  GraphFile graph;
  read_graph(path, 0, graph);
  SolveOptions options;
  const SolveOutcome whole = solve(graph, options);
  for (const Vertex& v : whole.solution.vertices) graph.truth[v.id] = v.pose;  // to compare with
  options.max_nodes = 350;
  const SolveOutcome small = solve(graph, options);
  EXPECT_LE(small.solution.vertices.size(), 350u);
  ASSERT_TRUE(small.accuracy);
  EXPECT_LT(small.accuracy->ate_rms_m, 1.0);
}

}  // namespace
}  // namespace maplet::graphs
