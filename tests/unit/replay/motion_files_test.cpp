// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/motion_files.hpp"

#include <gtest/gtest.h>

#include <string>

namespace maplet {
namespace {

using namespace std::chrono_literals;

TEST(MotionFiles, InterpolatesPoses) {
  MotionFiles files;
  files.parse_odometry("# comment\n1.0 0 0 0 0 0 0 1\n1.1 0.1 0 0 0 0 0 1\n");
  const MotionHint hint = files.at(1025ms);
  ASSERT_TRUE(hint.has_pose);
  EXPECT_NEAR(hint.T_external_camera.t.x(), 0.025, 1e-9);
  EXPECT_FALSE(hint.has_turn);
  EXPECT_TRUE(files.at(1000ms).has_pose);
  EXPECT_TRUE(files.at(1100ms).has_pose);
}

TEST(MotionFiles, HasNoHintOutsideAndInHoles) {
  MotionFiles files;
  files.parse_odometry("1.0 0 0 0 0 0 0 1\n1.5 1 0 0 0 0 0 1\n");
  EXPECT_FALSE(files.at(999ms).has_pose);
  EXPECT_FALSE(files.at(1250ms).has_pose);
  EXPECT_FALSE(files.at(1501ms).has_pose);
}

TEST(MotionFiles, IntegratesRates) {
  MotionFiles files;
  files.parse_gyro("0.0 0 0.5 0\n0.1 0 0.5 0\n0.2 0 0.5 0\n0.3 0 0.5 0\n");
  const MotionHint from = files.at(50ms);
  const MotionHint to = files.at(250ms);
  ASSERT_TRUE(from.has_turn && to.has_turn);
  const Eigen::Quaterniond turn = from.q_gyro_camera.conjugate() * to.q_gyro_camera;
  EXPECT_NEAR(2.0 * std::asin(turn.y()), 0.1, 1e-6);
}

TEST(MotionFiles, SkipsAndCountsWhatMakesNoSense) {
  MotionFiles files;
  files.parse_odometry(
      "1.0 0 0 0 0 0 0 1\n"
      "rubbish\n"
      "1.1 0 0 0 0 0 0\n"  // a number short
      "1.2 nan 0 0 0 0 0 1\n"
      "1.3 0 0 0 0 0 0 2\n"       // no unit quaternion
      "1.0 1 0 0 0 0 0 1\n"       // the stamp was there
      "1.05 1e9 0 0 0 0 0 1\n");  // beyond the earth
  EXPECT_EQ(files.poses(), 1u);
  EXPECT_EQ(files.skipped(), 6u);
  files.parse_gyro("1 0 0 0\n1 0 0 0\n2 1e3 0 0\n3 inf 0 0\n");
  EXPECT_EQ(files.rates(), 1u);
  EXPECT_EQ(files.skipped(), 9u);
  EXPECT_EQ(
      files.skipped_where(),
      "6 lines of odometry.txt make no sense, the first is line 2; 3 lines of gyro.txt make no "
      "sense, the first is line 4");
}

TEST(MotionFiles, SortsLines) {
  MotionFiles files;
  files.parse_odometry("1.1 0.1 0 0 0 0 0 1\n1.0 0 0 0 0 0 0 1\n1.2 0.2 0 0 0 0 0 1\n");
  EXPECT_EQ(files.poses(), 3u);
  EXPECT_EQ(files.skipped(), 0u);
  EXPECT_NEAR(files.at(1050ms).T_external_camera.t.x(), 0.05, 1e-9);
}

TEST(MotionFiles, SumsUpTheCovariancesOfSteps) {
  MotionFiles files;
  files.parse_odometry(
      "1.0 0 0 0 0 0 0 1 1e-4 1e-4 1e-4 1e-6 1e-6 1e-6\n"
      "1.1 0.1 0 0 0 0 0 1 1e-4 2e-4 1e-4 1e-6 1e-6 1e-6\n"
      "1.2 0.2 0 0 0 0 0 1 -1 1e-4 1e-4 1e-6 1e-6 1e-6\n");  // no variance
  EXPECT_EQ(files.poses(), 2u);
  EXPECT_EQ(files.skipped(), 1u);
  const Matrix6d step = files.at(1100ms).path_covariance - files.at(1000ms).path_covariance;
  EXPECT_NEAR(step(0, 0), 1e-4, 1e-12);
  EXPECT_NEAR(step(1, 1), 2e-4, 1e-12);
  EXPECT_NEAR(step(5, 5), 1e-6, 1e-15);
}

TEST(MotionFiles, IntegratesTwists) {
  MotionFiles files;
  std::string text = "# stamp vx vy vz wx wy wz and their variances\n";
  for (int i = 0; i <= 10; ++i) {
    text += std::to_string(1.0 + 0.1 * i) + " 0.5 0 0 0 0.2 0 0.01 0.01 0.01 4e-4 4e-4 4e-4\n";
  }
  files.parse_odometry(text);
  EXPECT_EQ(files.poses(), 11u);
  Vector6d twist;
  twist << 0.5, 0, 0, 0, 0.2, 0;
  const Se3 moved =
      files.at(1000ms).T_external_camera.inverse() * files.at(2000ms).T_external_camera;
  EXPECT_LT((Se3::exp(twist).inverse() * moved).log().norm(), 1e-9);
  const Matrix6d path = files.at(2000ms).path_covariance - files.at(1000ms).path_covariance;
  EXPECT_NEAR(path(0, 0), 10 * 0.01 * 0.01, 1e-9);
}

TEST(MotionFiles, AFolderWithoutAnyIsFine) {
  const auto files = MotionFiles::read("/nonexistent");
  ASSERT_TRUE(files);
  EXPECT_FALSE(files->at(0ms).has_pose);
}

}  // namespace
}  // namespace maplet
