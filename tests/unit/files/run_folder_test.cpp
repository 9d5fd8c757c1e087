// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/files/run_folder.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/synthetic_run.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet::files {
namespace {

class RunFolder : public ::testing::Test {
 protected:
  void SetUp() override { test::write_synthetic_run(folder_, {.frames = 60, .maplets = 5}); }

  /// What read_run says about the folder.
  std::string complaint() const {
    try {
      (void)read_run(folder_);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "";
  }

  test::TempDir dir_;
  const std::filesystem::path folder_ = dir_ / "run";
};

TEST_F(RunFolder, IsReadBack) {
  const files::Run run = read_run(folder_);
  EXPECT_EQ(run.name, folder_.filename());
  EXPECT_EQ(run.trajectory.size(), 60u);
  EXPECT_EQ(run.odometry.size(), 60u);
  EXPECT_EQ(run.nodes.size(), 5u);
  ASSERT_EQ(run.maplets.size(), 5u);
  ASSERT_EQ(run.edges.size(), 5u);
  EXPECT_EQ(std::ranges::count_if(run.edges, &RunEdge::closure), 1);
  EXPECT_TRUE(run.edges.back().closure());
  EXPECT_EQ(run.counts.frames, 60u);
  EXPECT_EQ(run.counts.point_cloud_bytes, 5 * 3.1e6);
  EXPECT_GT(run.counts.maplet_bytes.value(), 500.0);

  // A surface, placed by its node, lies on one of the panels it was made of.
  const auto panels = test::flat();
  const RunMaplet& maplet = run.maplets[2];
  ASSERT_FALSE(maplet.surfaces.empty());
  for (const Surface& surface : maplet.surfaces) {
    const Surface placed = moved(maplet.T_world_maplet.se3, surface);
    double nearest = 1e9;
    for (const test::Panel& panel : panels) {
      const Eigen::Vector3d n = panel.a.cross(panel.b).normalized();
      const double off_m =
          std::abs(placed.plane.distance(panel.corner)) + (1.0 - std::abs(n.dot(placed.plane.n)));
      nearest = std::min(nearest, off_m);
    }
    EXPECT_LT(nearest, 1e-3);
  }
}

TEST_F(RunFolder, OdometryStartsWhereTheTrajectoryDoes) {
  std::ofstream{folder_ / "trajectory.tum"}
      << "10 4 5 6 0 0 0.7071067811865476 0.7071067811865476\n"
         "11 4 6 6 0 0 0.7071067811865476 0.7071067811865476\n";
  std::ofstream{folder_ / "odometry.tum"} << "9 0 0 0 0 0 0 1\n10 1 0 0 0 0 0 1\n"
                                             "11 2.5 0 0 0 0 0 1\n";
  const files::Run run = read_run(folder_);
  ASSERT_EQ(run.odometry.size(), 3u);
  EXPECT_LT((run.odometry[1].pose.t - Eigen::Vector3d{4, 5, 6}).norm(), 1e-9);
  EXPECT_LT((run.odometry[2].pose.t - Eigen::Vector3d{4, 6.5, 6}).norm(), 1e-9);
}

TEST_F(RunFolder, DoesWithoutWhatIsOptional) {
  for (const char* name : {"odometry.tum", "trajectory.tum", "report.json", "maplets"}) {
    std::filesystem::remove_all(folder_ / name);
  }
  const files::Run run = read_run(folder_);
  EXPECT_EQ(run.nodes.size(), 5u);
  EXPECT_TRUE(run.maplets.empty());
  EXPECT_FALSE(run.counts.frames);
}

TEST_F(RunFolder, CountsMapletsThatNothingPlaces) {
  std::filesystem::copy(folder_ / "maplets/0001.maplet", folder_ / "maplets/0077.maplet");
  std::ofstream{folder_ / "maplets/notes.txt"} << "not a maplet";
  const files::Run run = read_run(folder_);
  EXPECT_EQ(run.maplets.size(), 5u);
  EXPECT_EQ(run.unplaced, 1u);
}

TEST_F(RunFolder, NamesTheDamagedFile) {
  std::ofstream{folder_ / "maplets/0003.maplet"} << "short";
  EXPECT_NE(complaint().find("0003.maplet: "), std::string::npos) << complaint();
}

TEST_F(RunFolder, NamesTheDamagedLine) {
  std::ofstream{folder_ / "skeleton.g2o"}
      << "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 x\n";
  EXPECT_NE(complaint().find("skeleton.g2o:2: no valid VERTEX_SE3:QUAT line"), std::string::npos);
  std::ofstream{folder_ / "skeleton.g2o"} << "EDGE_SE3:QUAT 0\n";
  EXPECT_NE(complaint().find("skeleton.g2o:1: no valid EDGE_SE3:QUAT line"), std::string::npos);
}

TEST_F(RunFolder, NamesTheDamagedReport) {
  std::ofstream{folder_ / "report.json"} << "{\"frames\":";
  EXPECT_NE(complaint().find("report.json: no JSON"), std::string::npos);
}

TEST_F(RunFolder, RefusesAnotherFolder) {
  std::filesystem::remove(folder_ / "skeleton.g2o");
  std::filesystem::remove(folder_ / "trajectory.tum");
  EXPECT_NE(complaint().find("holds neither skeleton.g2o nor trajectory.tum"), std::string::npos);
}

}  // namespace
}  // namespace maplet::files
