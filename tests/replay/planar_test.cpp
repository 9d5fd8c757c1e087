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

  /// @return what it says
  std::string map(const std::string& source, const std::string& up) {
    const Finished done =
        map_it(source, dir_ / "out", {"--set", "motion=planar", "--set", "body.up=" + up});
    EXPECT_EQ(done.exit_code, 0) << done.err;
    return done.err;
  }
};

double dot(const json& a, const json& b) {
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) sum += a[i].get<double>() * b[i].get<double>();
  return sum;
}

// A vehicle whose camera looks down a little: nobody says by how much.
TEST_F(Planar, DeltaPosesOfAPitchedCameraHaveThreeNumbers) {
  map("sim:loop?seed=3&frames=400&width=320&wobble=0", "auto");
  const auto lines = delta_poses(dir_ / "out");
  ASSERT_GE(lines.size(), 2U);
  const json plane = report_of(dir_ / "out")["tracking"]["plane"];
  EXPECT_EQ(plane["from"], "floor");
  EXPECT_NEAR(std::acos(-plane["up"][1].get<double>()), 0.093, 0.01);
  for (const json& line : lines) {
    ASSERT_TRUE(line.contains("planar")) << line.dump();
    const json& planar = line["planar"];
    const json& T = line["T_a_b"];
    EXPECT_EQ(planar["up"], plane["up"]);  // of all lines, to the last bit
    ASSERT_EQ(planar["delta"].size(), 3U);
    ASSERT_EQ(planar["covariance"].size(), 9U);
    EXPECT_NEAR(dot(planar["up"], T), 0.0, 1e-9);
    EXPECT_NEAR(dot(T, T),
                std::pow(planar["delta"][0].get<double>(), 2) +
                    std::pow(planar["delta"][1].get<double>(), 2),
                1e-9);
    const json turn{T[3], T[4], T[5]};
    EXPECT_NEAR(2.0 * std::asin(-dot(planar["up"], turn)), planar["delta"][2].get<double>(), 1e-9);
    double out_of_plane = 0.0;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        out_of_plane += planar["up"][i].get<double>() * planar["up"][j].get<double>() *
                        line["covariance"][6 * i + j].get<double>();
      }
    }
    EXPECT_NEAR(out_of_plane, 0x1p-16, 1e-12);  // 4 mm: what floor and up are off by
    for (const int i : {0, 4, 8}) EXPECT_GT(planar["covariance"][i].get<double>(), 0.0);
  }
}

TEST_F(Planar, OfALevelCameraTheyAreXZAndTheTurnAboutY) {
  map("sim:loop?seed=3&frames=200&width=320&wobble=0", "[0, -1, 0]");
  const auto lines = delta_poses(dir_ / "out");
  ASSERT_GE(lines.size(), 1U);
  for (const json& line : lines) {
    EXPECT_EQ(line["T_a_b"][1], 0.0);
    EXPECT_EQ(line["planar"]["delta"][0], line["T_a_b"][0]);
    EXPECT_EQ(line["planar"]["delta"][1], line["T_a_b"][2]);
    EXPECT_NEAR(2.0 * std::asin(line["T_a_b"][4].get<double>()),
                line["planar"]["delta"][2].get<double>(), 1e-6);
  }
  for (const char* path : {"odometry.tum", "trajectory.tum"}) {
    for (const double y : heights_of(dir_ / "out" / path)) EXPECT_NEAR(y, 0.0, 1e-3);
  }
}

TEST_F(Planar, RegisterAndMatchCanBeHeldToThePlane) {
  map("sim:loop?seed=3&frames=400&width=320&wobble=0", "auto");
  const auto first = (dir_ / "out" / "maplets" / "0000.maplet").string();
  const auto second = (dir_ / "out" / "maplets" / "0001.maplet").string();
  const json flat =
      json::parse(run({"mapletctl", "register", first, second, "--planar", "--json"}).out);
  ASSERT_TRUE(flat.contains("planar")) << flat.dump();
  EXPECT_NEAR(dot(flat["planar"]["up"], flat["T_a_b"]), 0.0, 1e-9);
  const json link = delta_poses(dir_ / "out").at(0);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(flat["planar"]["delta"][i].get<double>(), link["planar"]["delta"][i].get<double>(),
                0.02);
  }
  EXPECT_FALSE(
      json::parse(run({"mapletctl", "register", first, second, "--json"}).out).contains("planar"));
  const auto folder = (dir_ / "out").string();
  std::istringstream lines{run({"mapletctl", "match", folder, folder, "--planar", "--json"}).out};
  int pairs = 0;
  for (std::string line; std::getline(lines, line); ++pairs) {
    EXPECT_TRUE(json::parse(line).contains("planar")) << line;
  }
  EXPECT_GT(pairs, 0);
}

// Two starts of one mission are in one plane: what the first view of the second shows is not asked.
TEST_F(Planar, AMissionKeepsItsPlane) {
  const auto start = [&](const char* out, const char* phase) {
    const Finished done =
        map_it(std::string{"sim:loop?seed=3&frames=200&width=320&phase="} + phase, dir_ / out,
               {"--set", "motion=planar", "--state", (dir_ / "state").string()});
    EXPECT_EQ(done.exit_code, 0) << done.err;
    return report_of(dir_ / out)["tracking"]["plane"];
  };
  const json first = start("first", "0.1");
  const json second = start("second", "0.6");
  EXPECT_EQ(first["from"], "floor");
  EXPECT_EQ(second["from"], "mission");
  EXPECT_EQ(first["up"], second["up"]);
}

TEST_F(Planar, ATiltedCameraMovesInTheFloorsPlaneAndAutoFindsIt) {
  map("sim:room?seed=2&frames=200&width=320&wobble=0", "auto");
  ASSERT_GE(delta_poses(dir_ / "out").size(), 1U);
  const json report = report_of(dir_ / "out");
  EXPECT_EQ(report["tracking"]["lost"], 0);
  EXPECT_EQ(report["tracking"]["off_plane"], 0);
}

TEST_F(Planar, SaysHowOftenTheCameraWasOffThePlane) {
  const std::string said =
      map("sim:loop?seed=3&frames=200&width=320&wobble=0", "[0, -0.9, -0.436]");
  EXPECT_GT(report_of(dir_ / "out")["tracking"]["off_plane"], 20);
  EXPECT_NE(said.find("off the plane"), std::string::npos) << said;
}

// Two degrees are not seen by a keyframe's length, but the floor is in view.
TEST_F(Planar, AnUpThatTheFloorContradictsIsSaid) {
  const std::string said =
      map("sim:loop?seed=3&frames=60&width=320&wobble=0", "[0, -0.998, -0.058]");
  EXPECT_NE(said.find("2.0 deg from body.up"), std::string::npos) << said;
  const std::string right =
      map("sim:loop?seed=3&frames=60&width=320&wobble=0", "[0, -0.99567, -0.09296]");
  EXPECT_EQ(right.find("body.up"), std::string::npos) << right;
}

// Up in the body's axes instead of the camera's: nothing fits, nothing crashes, and it is said.
TEST_F(Planar, UpInTheBodysAxesIsDoubted) {
  const std::string said = map("sim:loop?seed=3&frames=400&width=320&wobble=0", "[0, 0, 1]");
  EXPECT_NE(said.find("90 deg from where body.T_body_camera has it"), std::string::npos) << said;
  EXPECT_NE(said.find("off the plane"), std::string::npos) << said;
}

TEST_F(Planar, MotionIsOneOfTwoWords) {
  EXPECT_EQ(run({"mapletd", "--check-config", "--set", "motion=planar"}).exit_code, 0);
  EXPECT_EQ(run({"mapletd", "--check-config", "--set", "motion=3d"}).exit_code, 0);
  EXPECT_EQ(run({"mapletd", "--check-config", "--set", "motion=2d"}).exit_code, 2);
}

}  // namespace
}  // namespace maplet::test
