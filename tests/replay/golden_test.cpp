// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A seeded mission against what it gave when it was last looked at (tests/replay/golden/*.json):
// counters exactly, poses to the tolerances below. MAPLET_GOLDEN_UPDATE=1 writes the files anew.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "tests/support/run.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet::test {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

// Other processors' maths libraries round differently; the missions below amplify that little.
constexpr double kMostPose_m = 0.002;
constexpr double kRmsPose_m = 0.001;
constexpr double kRmsTurn_deg = 0.01;
constexpr std::size_t kEveryNthPose = 20;

fs::path golden_file(const std::string& name) {
  return fs::path{std::getenv("MAPLET_SOURCE_DIR")} / "tests/replay/golden" / (name + ".json");
}

/// Every n-th line of a TUM file: stamp, position, quaternion.
Json sampled_poses(const fs::path& tum) {
  std::ifstream in{tum};
  Json poses = Json::array();
  std::size_t count = 0;
  for (std::string line; std::getline(in, line); ++count) {
    if (count % kEveryNthPose != 0) continue;
    std::istringstream words{line};
    std::array<double, 8> pose{};
    for (double& number : pose) words >> number;
    poses.push_back(pose);
  }
  return poses;
}

Json outcome_of(const fs::path& out) {
  const auto report = report_of(out);
  Json outcome;
  outcome["frames"] = report["frames"];
  outcome["tracking"] = report["tracking"];
  outcome["maplets"] = report["maplets"]["count"];
  outcome["delta_poses"] = report["delta_poses"]["count"];
  outcome["odometry"] = sampled_poses(out / "odometry.tum");
  outcome["trajectory"] = sampled_poses(out / "trajectory.tum");
  return outcome;
}

Eigen::Isometry3d pose_of(const Json& line) {
  const auto n = line.get<std::array<double, 8>>();
  Eigen::Isometry3d pose{Eigen::Quaterniond{n[7], n[4], n[5], n[6]}.normalized()};
  pose.translation() << n[1], n[2], n[3];
  return pose;
}

void expect_poses_near(const Json& is, const Json& was) {
  ASSERT_EQ(is.size(), was.size());
  ASSERT_FALSE(is.empty());
  double squared_m2 = 0.0, squared_rad2 = 0.0;
  for (std::size_t i = 0; i < is.size(); ++i) {
    EXPECT_EQ(is[i][0], was[i][0]);
    const Eigen::Isometry3d between = pose_of(was[i]).inverse() * pose_of(is[i]);
    EXPECT_LT(between.translation().norm(), kMostPose_m) << "at " << is[i][0] << " s";
    squared_m2 += between.translation().squaredNorm();
    squared_rad2 += std::pow(Eigen::AngleAxisd{between.rotation()}.angle(), 2);
  }
  const auto count = static_cast<double>(is.size());
  EXPECT_LT(std::sqrt(squared_m2 / count), kRmsPose_m);
  EXPECT_LT(std::sqrt(squared_rad2 / count) * 180.0 / M_PI, kRmsTurn_deg);
}

void check_mission(const std::string& name, const std::string& source) {
  const TempDir dir;
  const Finished mapped = map_it(source, dir / "out");
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  Json is = outcome_of(dir / "out");
  if (std::getenv("MAPLET_GOLDEN_UPDATE") != nullptr) {
    std::ofstream{golden_file(name)} << is.dump(1) << '\n';
  }
  std::ifstream file{golden_file(name)};
  Json was = Json::parse(file);
  for (const char* trajectory : {"odometry", "trajectory"}) {
    expect_poses_near(is[trajectory], was[trajectory]);
    is.erase(trajectory);
    was.erase(trajectory);
  }
  EXPECT_EQ(is, was) << "now " << is.dump();
}

TEST(Golden, Room) { check_mission("room", "sim:room?seed=2&frames=200&width=320"); }

TEST(Golden, StartOfTheLoop) { check_mission("loop", "sim:loop?seed=3&frames=200&width=320"); }

}  // namespace
}  // namespace maplet::test
