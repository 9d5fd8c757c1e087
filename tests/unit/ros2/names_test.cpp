// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/ros2/names.hpp"

#include <gtest/gtest.h>

namespace maplet {
namespace {

TEST(RosNames, TopicsAreNamedAsRosNamesThem) {
  EXPECT_EQ(dds_topic("", "odom"), "rt/odom");
  EXPECT_EQ(dds_topic("robot1", "odom"), "rt/robot1/odom");
  EXPECT_EQ(dds_topic("/robot1/slam", "odom"), "rt/robot1/slam/odom");
  EXPECT_EQ(dds_topic("robot1", "/wheel/odometry"), "rt/wheel/odometry");
}

TEST(RosNames, DefaultsAreFine) { EXPECT_EQ(names_problem(Ros2Config{}), ""); }

TEST(RosNames, WhatRosRefusesIsRefusedWithTheKey) {
  for (const char* bad : {"", "/", "a//b", "a/", "1odom", "odom-raw", "a b", "a__b", "a/1", "~x"}) {
    Ros2Config config;
    config.odometry_topic = bad;
    EXPECT_NE(names_problem(config).find("ros2.odometry_topic"), std::string::npos) << bad;
  }
  Ros2Config frames;
  frames.base_frame = "/base_link";
  EXPECT_NE(names_problem(frames).find("ros2.base_frame"), std::string::npos);
  frames.base_frame = "odom";
  EXPECT_NE(names_problem(frames), "");
}

TEST(RosNames, OdometryTakesNoOtherTopicOfOurs) {
  for (const char* taken : {"path", "/robot1/map_markers", "/tf", "/diagnostics"}) {
    Ros2Config config;
    config.name_space = "robot1";
    config.odometry_topic = taken;
    EXPECT_NE(names_problem(config).find("ros2.odometry_topic"), std::string::npos) << taken;
  }
}

TEST(RosNames, NobodyListensToItself) {
  Ros2Config config;
  config.external_odometry = "/odom";
  EXPECT_EQ(names_problem(config), "") << "ours is not published";
  config.enabled = true;
  EXPECT_NE(names_problem(config).find("ros2.external_odometry"), std::string::npos);
  config.name_space = "robot1";
  EXPECT_EQ(names_problem(config), "");
}

}  // namespace
}  // namespace maplet
