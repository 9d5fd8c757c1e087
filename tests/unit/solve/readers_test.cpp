// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "tools/solve/graph_file.hpp"
#include "tools/solve/order.hpp"

namespace maplet::graphs {
namespace {

TEST(Pyfg, ReadsOdometryRangesAndTheTruth) {
  GraphFile graph;
  read_pyfg(
      "VERTEX_SE2 10.5 A0 1 2 0.5\n"
      "VERTEX_SE2 10.6 A1 2 2 0.5\n"
      "VERTEX_XY L0 5 6\n"
      "EDGE_SE2 10.6 A0 A1 1.0 0.0 0.1 0.04 0 0 0.04 0 0.01\n"
      "EDGE_RANGE 10.5 A0 L0 5.6 0.25\n",
      0, graph);
  EXPECT_EQ(graph.bad_lines, 0u);
  EXPECT_TRUE(graph.planar);
  EXPECT_TRUE(graph.vertices.empty()) << "the truth is no start";
  EXPECT_EQ(graph.truth.size(), 3u);
  ASSERT_EQ(graph.edges.size(), 2u);
  EXPECT_EQ(graph.edges[0].a, symbol('A', 0));
  EXPECT_NEAR(graph.edges[0].information(0, 0), 25.0, 1e-9);
  EXPECT_NEAR(graph.edges[0].information(5, 5), 100.0, 1e-9);
  EXPECT_EQ(graph.edges[1].kind, FactorKind::kRange);
  EXPECT_NEAR(graph.edges[1].range_m, 5.6, 1e-12);
  EXPECT_NEAR(graph.edges[1].information(0, 0), 4.0, 1e-9);
  EXPECT_TRUE(graph.points.contains(symbol('L', 0)));
  EXPECT_NEAR(graph.stamps_s.at(symbol('A', 1)), 10.6, 1e-12);
}

TEST(Pyfg, ComplainsOfWhatMakesNoSense) {
  GraphFile graph;
  read_pyfg(
      "EDGE_RANGE 10.5 A0 L0 -5.6 0.25\n"
      "EDGE_RANGE 10.5 A0 L0 5.6 -0.25\n"
      "EDGE_RANGE 10.5 A0 L0 nan 0.25\n"
      "EDGE_RANGE 10.5 A0 7 5.6 0.25\n"
      "EDGE_RANGE 10.5 L1 L0 5.6 0.25\n"
      "EDGE_SE2 10.6 A0 A1 1.0 0.0 0.1 0.04 0 0 0 0 0\n"
      "EDGE_SE2 10.6 A0 A1 1.0\n"
      "EDGE_UNHEARD_OF 1 2 3\n",
      0, graph);
  EXPECT_EQ(graph.bad_lines, 7u);
  EXPECT_EQ(graph.unknown_lines, 1u);
  graph.note_unknown("SECOND");
  EXPECT_EQ(graph.unknown_lines, 2u);
  EXPECT_NE(graph.unknown_tag, "SECOND");
  GraphFile garbage;
  garbage.note_unknown("\x1b[2J" + std::string(100, 'a'));
  EXPECT_EQ(garbage.unknown_tag, "?[2J" + std::string(36, 'a'));
  EXPECT_TRUE(graph.edges.empty());
}

TEST(G2o, SightsAreReadBackAsWritten) {
  GraphFile graph;
  read_g2o(
      "VERTEX_SE2 0 0 0 0\nVERTEX_XY 9 1 2\n"
      "EDGE_SE2_XY 0 9 1 2 10 0.5 20\n"
      "EDGE_RANGE_SE2_XY 0 9 2.5 100\n"
      "EDGE_BEARING_SE2_XY 0 9 1.1 400\n",
      0, graph);
  ASSERT_EQ(graph.edges.size(), 3u);
  EXPECT_EQ(graph.bad_lines, 0u);
  std::ostringstream first, second;
  write_g2o(first, graph);
  GraphFile again;
  read_g2o(first.str(), 0, again);
  write_g2o(second, again);
  EXPECT_EQ(first.str(), second.str());
  EXPECT_EQ(again.edges.size(), 3u);
  EXPECT_TRUE(again.points.contains(9));
}

/// Two robots: one drives a metre a second, the other stands and turns.
MrclamTexts two_robots() {
  MrclamTexts texts;
  texts.barcodes = "# Subject Barcode\n 1 5\n 2 14\n 6 63\n";
  texts.robots.resize(2);
  for (int k = 0; k <= 100; ++k) {
    const std::string t = std::to_string(100.0 + 0.1 * k);
    texts.robots[0].odometry += t + " 1.0 0.0\n";
    texts.robots[1].odometry += t + " 0.0 0.1\n";
  }
  texts.robots[0].measurements = "102.3 63 4.0 0.5\n102.0 14 3.0 0.1\n103.0 77 1.0 0.0\n";
  texts.robots[0].groundtruth = "101.99 7 8 0.25\n102.01 7.1 8 0.25\n105 9 9 9\n";
  return texts;
}

TEST(Mrclam, OdometryIsMergedToSecondsAndSightsMovedToThem) {
  GraphFile graph;
  read_mrclam(two_robots(), 0, graph);
  EXPECT_EQ(graph.bad_lines, 1u) << "barcode 77 is nobody's";
  EXPECT_EQ(graph.complaints.at(0).part, "Robot1_Measurement.dat");
  EXPECT_EQ(graph.complaints.at(0).line, 3);
  int odometry = 0;
  const Edge* landmark = nullptr;
  const Edge* robot = nullptr;
  for (const Edge& e : graph.edges) {
    if (is_odometry(e)) ++odometry;
    if (e.b == symbol('L', 6)) landmark = &e;
    if (e.b == symbol('B', 2) && e.kind == FactorKind::kRangeBearing) robot = &e;
  }
  EXPECT_EQ(odometry, 20);
  EXPECT_NEAR(graph.edges[0].z.t.x(), 1.0, 1e-9);
  ASSERT_NE(landmark, nullptr);
  EXPECT_EQ(landmark->a, symbol('A', 2));
  // Seen 0.3 m further on, 4 m away at 0.5 rad.
  const double x = 0.3 + 4.0 * std::cos(0.5);
  const double y = 4.0 * std::sin(0.5);
  EXPECT_NEAR(landmark->range_m, std::hypot(x, y), 1e-6);
  EXPECT_NEAR(landmark->bearing_rad, std::atan2(y, x), 1e-6);
  ASSERT_NE(robot, nullptr);
  EXPECT_NEAR(robot->range_m, 3.0, 1e-9);
  EXPECT_NEAR(graph.truth.at(symbol('A', 2)).t.x(), 7.0, 0.11);
}

TEST(G2o, TheSameFaultIsNamedThreeTimesAndCounted) {
  GraphFile graph;
  std::string text;
  for (int k = 0; k < 50; ++k) text += "EDGE_SE2 1 2 x\n";
  read_g2o(text, 0, graph);
  EXPECT_EQ(graph.bad_lines, 50u);
  ASSERT_EQ(graph.complaints.size(), 3u);
  EXPECT_EQ(graph.complaints[2].line, 3);
  EXPECT_EQ(graph.complaints[2].more, 47u);
}

TEST(Mrclam, AnEmptyOrBrokenFolderIsNoGraph) {
  GraphFile graph;
  read_mrclam({}, 0, graph);
  EXPECT_TRUE(graph.edges.empty());
  MrclamTexts texts = two_robots();
  texts.robots[0].odometry = "nonsense\n1 2\nnan nan nan\n";
  GraphFile broken;
  read_mrclam(texts, 0, broken);
  EXPECT_EQ(broken.bad_lines, 3u);
}

}  // namespace
}  // namespace maplet::graphs
