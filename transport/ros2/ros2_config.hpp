// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/base/field.hpp"

namespace maplet {

/// What ROS 2 nodes on this robot see, in the local domain (dds.domain is their ROS_DOMAIN_ID).
/// Section [ros2]. Off by default: a robot's base publishes odom and tf of its own, and two of them
/// on one graph are worse than none.
struct Ros2Config {
  bool enabled = false;
  std::string name_space;
  std::string odometry_topic = "odom";
  std::string clock = "auto";
  std::string map_frame = "map";
  std::string odom_frame = "odom";
  std::string base_frame = "base_link";
  bool tf = true;
  double odometry_hz = 30.0;
  double path_hz = 1.0;
  double map_hz = 1.0;
  int path_poses = 1000;
  int map_quads = 16384;
  std::string external_odometry;
  std::string external_frame;

  /// Something of it runs.
  [[nodiscard]] bool used() const noexcept { return enabled || !external_odometry.empty(); }

  static constexpr Field<Ros2Config> kFields[] = {
      {"enabled", &Ros2Config::enabled, 0, 0,
       "Publish odometry, path, map, diagnostics and tf as ROS 2 nodes expect them"},
      {"namespace", &Ros2Config::name_space, 0, 0,
       "Before the names of odometry, path and map: robot1; tf and diagnostics have none"},
      {"odometry_topic", &Ros2Config::odometry_topic, 0, 0,
       "Name of the odometry; path and map_markers are beside it"},
      {"clock", &Ros2Config::clock, 0, 0,
       "Clock of the stamps, in and out: the system's, the source's own, or auto: the system's for "
       "a camera, the recording's for a recording",
       "auto|system|source"},
      {"map_frame", &Ros2Config::map_frame, 0, 0, "Name of the map's frame"},
      {"odom_frame", &Ros2Config::odom_frame, 0, 0, "Name of the odometry's frame"},
      {"base_frame", &Ros2Config::base_frame, 0, 0,
       "Name of the robot's body (body.T_body_camera); external odometry is to be of it, too"},
      {"tf", &Ros2Config::tf, 0, 0, "Publish map to odom and odom to base on tf"},
      {"odometry_hz", &Ros2Config::odometry_hz, 0.1, 1000.0, "Odometry and tf, at most"},
      {"path_hz", &Ros2Config::path_hz, 0.0, 10.0, "The path, at most; 0 = never"},
      {"map_hz", &Ros2Config::map_hz, 0.0, 10.0, "What has changed of the map, at most; 0 = never"},
      {"path_poses", &Ros2Config::path_poses, 2, 1000,
       "Poses of the path: when there are more, every second one is left out"},
      {"map_quads", &Ros2Config::map_quads, 16, 65536,
       "Pieces of surface in the map of all maplets; what does not fit is counted"},
      {"external_odometry", &Ros2Config::external_odometry, 0, 0,
       "Topic with nav_msgs/Odometry of somebody else, as prior of the motion: wheel/odometry; "
       "empty = none. Read without enabled, too"},
      {"external_frame", &Ros2Config::external_frame, 0, 0,
       "Its frame_id; empty = that of its first message"},
  };
};

}  // namespace maplet
