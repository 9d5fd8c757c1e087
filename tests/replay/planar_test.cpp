// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// motion = planar through the real programs: delta-poses of three numbers, a path on one floor.
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "tests/support/run.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet::test {
namespace {

using nlohmann::json;

std::vector<json> delta_poses(const std::filesystem::path& out) {
  std::vector<json> lines;
  std::istringstream in{text_of(out / "delta_poses.jsonl")};
  for (std::string line; std::getline(in, line);) lines.push_back(json::parse(line));
  return lines;
}

std::vector<double> heights_of(const std::filesystem::path& tum) {
  std::vector<double> out;
  std::istringstream in{text_of(tum)};
  for (std::string line; std::getline(in, line);) {
    std::istringstream words{line};
    double stamp = 0.0, x = 0.0, y = 0.0;
    words >> stamp >> x >> y;
    out.push_back(y);
  }
  return out;
}

class Planar : public testing::Test {
 protected:
  TempDir dir_;

  void map(const std::string& source, const std::string& up) {
    const Finished done =
        map_it(source, dir_ / "out", {"--set", "motion=planar", "--set", "body.up=" + up});
    ASSERT_EQ(done.exit_code, 0) << done.err;
  }
};

// A level camera on a vehicle.
TEST_F(Planar, DeltaPosesHaveThreeNumbers) {
  map("sim:loop?seed=3&frames=400&width=320&wobble=0", "[0, -1, 0]");
  const auto lines = delta_poses(dir_ / "out");
  ASSERT_GE(lines.size(), 2U);
  for (const json& line : lines) {
    ASSERT_TRUE(line.contains("planar")) << line.dump();
    ASSERT_EQ(line["planar"]["delta"].size(), 3U);
    ASSERT_EQ(line["planar"]["covariance"].size(), 9U);
    EXPECT_EQ(line["T_a_b"][1], 0.0);
    EXPECT_EQ(line["planar"]["delta"][0], line["T_a_b"][0]);
    EXPECT_EQ(line["planar"]["delta"][1], line["T_a_b"][2]);
    EXPECT_NEAR(2.0 * std::asin(line["T_a_b"][4].get<double>()),
                line["planar"]["delta"][2].get<double>(), 1e-6);
    for (const int i : {0, 4, 8}) EXPECT_GT(line["planar"]["covariance"][i].get<double>(), 0.0);
  }
  for (const char* path : {"odometry.tum", "trajectory.tum"}) {
    for (const double y : heights_of(dir_ / "out" / path)) EXPECT_NEAR(y, 0.0, 1e-3);
  }
}

TEST_F(Planar, ATiltedCameraMovesInTheFloorsPlaneAndAutoFindsIt) {
  map("sim:room?seed=2&frames=200&width=320&wobble=0", "auto");
  ASSERT_GE(delta_poses(dir_ / "out").size(), 1U);
  const json report = report_of(dir_ / "out");
  EXPECT_EQ(report["tracking"]["lost"], 0);
  EXPECT_EQ(report["tracking"]["off_plane"], 0);
}

TEST_F(Planar, SaysHowOftenTheCameraWasOffThePlane) {
  map("sim:loop?seed=3&frames=200&width=320&wobble=0", "[0, -0.9, -0.436]");
  EXPECT_GT(report_of(dir_ / "out")["tracking"]["off_plane"], 20);
}

TEST_F(Planar, MotionIsOneOfTwoWords) {
  EXPECT_EQ(run({"mapletd", "--check-config", "--set", "motion=planar"}).exit_code, 0);
  EXPECT_EQ(run({"mapletd", "--check-config", "--set", "motion=3d"}).exit_code, 0);
  EXPECT_EQ(run({"mapletd", "--check-config", "--set", "motion=2d"}).exit_code, 2);
}

}  // namespace
}  // namespace maplet::test
