// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/motion_files.hpp"

#include <gtest/gtest.h>

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
      "0.9 0 0 0 0 0 0 1\n"       // back in time
      "1.05 1e9 0 0 0 0 0 1\n");  // beyond the earth
  EXPECT_EQ(files.poses(), 1u);
  EXPECT_EQ(files.skipped(), 6u);
  files.parse_gyro("1 0 0 0\n1 0 0 0\n2 1e3 0 0\n3 inf 0 0\n");
  EXPECT_EQ(files.rates(), 1u);
  EXPECT_EQ(files.skipped(), 9u);
}

TEST(MotionFiles, AFolderWithoutAnyIsFine) {
  const auto files = MotionFiles::read("/nonexistent");
  ASSERT_TRUE(files);
  EXPECT_FALSE(files->at(0ms).has_pose);
}

}  // namespace
}  // namespace maplet
