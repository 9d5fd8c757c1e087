// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/agent/agent_config.hpp"
#include "core/base/field.hpp"
#include "daemon/autopilot_config.hpp"
#include "daemon/gpio_config.hpp"
#include "daemon/gray_config.hpp"
#include "daemon/journal_config.hpp"
#include "daemon/recorder_config.hpp"
#include "transport/dds/config.hpp"
#include "transport/dds/radio_config.hpp"
#include "transport/ros2/ros2_config.hpp"
#include "transport/security/security_config.hpp"
#include "transport/sync/sync_config.hpp"

namespace maplet::daemon {

/// Keys outside of any section.
struct MissionConfig {
  std::string motion = "3d";
  std::string output_frame = "enu_flu";

  static constexpr Field<MissionConfig> kFields[] = {
      {"motion", &MissionConfig::motion, 0, 0,
       "planar: the camera moves in the plane across body.up only, delta-poses have 3 numbers",
       "3d|planar"},
      {"output_frame", &MissionConfig::output_frame, 0, 0,
       "Axes of the autopilot's records: enu_flu (x forward at the start, y left, z up; body x "
       "forward, y left, z up), ned_frd (y right, z down in both), camera (as inside)",
       "enu_flu|ned_frd|camera"},
  };
};

/// Where frames come from.
struct InputConfig {
  std::string source;
  std::string gray = "auto";

  static constexpr Field<InputConfig> kFields[] = {
      {"source", &InputConfig::source, 0, 0,
       "Source URI: tum:DIR, openni2:, openni2:FILE.oni, sim:WORLD; --source overrides it"},
      {"gray", &InputConfig::gray, 0, 0, "Use a gray image registered to depth when there is one",
       "auto|off"},
  };
};

/// The depth camera, where a recording's camera.toml or the device does not say.
struct CameraConfig {
  int width_px = 0;
  int height_px = 0;
  double fx_px = 0.0;
  double fy_px = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;
  double metres_per_unit = 0.001;
  bool registered_to_colour = false;
  std::string noise = "structured_light";
  double disparity_k = 0.0;
  double tof_floor_m = 0.0;
  double tof_slope = 0.0;
  double correlated_px = 0.0;

  static constexpr Field<CameraConfig> kFields[] = {
      {"width_px", &CameraConfig::width_px, 0, kMaxWidthPx, "Image width; 0 = as the source says"},
      {"height_px", &CameraConfig::height_px, 0, kMaxHeightPx,
       "Image height; 0 = as the source says"},
      {"fx_px", &CameraConfig::fx_px, -1e5, 1e5, "Focal length in x; 0 = as the source says"},
      {"fy_px", &CameraConfig::fy_px, -1e5, 1e5, "Focal length in y; 0 = as the source says"},
      {"cx_px", &CameraConfig::cx_px, -1e5, 1e5, "Principal point in x"},
      {"cy_px", &CameraConfig::cy_px, -1e5, 1e5, "Principal point in y"},
      {"metres_per_unit", &CameraConfig::metres_per_unit, 1e-6, 1.0, "Metres of one depth unit"},
      {"registered_to_colour", &CameraConfig::registered_to_colour, 0, 0,
       "Gray has the viewpoint of depth, so that it may be used"},
      {"noise", &CameraConfig::noise, 0, 0, "Noise model of the sensor",
       "structured_light|stereo|tof"},
      {"disparity_k", &CameraConfig::disparity_k, 0.0, 1.0,
       "Structured light and stereo: sigma_z = k z^2, k = sigma of disparity / (focal length * "
       "baseline) in 1/m; 0 = typical: 0.001425 and 0.0038"},
      {"tof_floor_m", &CameraConfig::tof_floor_m, 0.0, 1.0,
       "Time of flight: sigma_z = floor + slope z; 0 = typical: 0.004"},
      {"tof_slope", &CameraConfig::tof_slope, 0.0, 1.0,
       "Time of flight: sigma_z = floor + slope z; 0 = typical: 0.002"},
      {"correlated_px", &CameraConfig::correlated_px, 0.0, 1000.0,
       "Pixels whose noise together tells as much as one independent pixel; 0 = typical: 4, 16 for "
       "stereo, 2 for tof"},
  };
};

/// How the camera sits on the robot.
struct BodyConfig {
  Vector3OrAuto up;
  std::string T_body_camera = "0,0,0,-0.5,0.5,-0.5,0.5";

  static constexpr Field<BodyConfig> kFields[] = {
      {"up", &BodyConfig::up, -1.0, 1.0,
       "Up in the camera's frame at start (x right, y down, z forward), or auto: from the dominant "
       "horizontal plane"},
      {"T_body_camera", &BodyConfig::T_body_camera, 0, 0,
       "Pose of the depth camera in the robot's body (x forward, y left, z up): "
       "x,y,z,qx,qy,qz,qw in m; the default looks straight ahead"},
  };
};

/// Who may ask the running daemon.
struct ControlConfig {
  std::string socket;

  static constexpr Field<ControlConfig> kFields[] = {
      {"socket", &ControlConfig::socket, 0, 0,
       "Unix socket for mapletctl; empty = agent-N.sock in $RUNTIME_DIRECTORY, /run/mapletd, "
       "$XDG_RUNTIME_DIR/mapletd or /tmp/mapletd-UID, none = no socket"},
  };
};

/// What the kernel is asked for. Section [realtime].
struct RealtimeConfig {
  int capture_priority = 0;
  int estimator_priority = 0;
  bool lock_memory = true;
  bool required = false;

  static constexpr Field<RealtimeConfig> kFields[] = {
      {"capture_priority", &RealtimeConfig::capture_priority, 0, 99,
       "First-in first-out priority of the thread that reads the camera; 0 = as any other"},
      {"estimator_priority", &RealtimeConfig::estimator_priority, 0, 99,
       "The same of the estimator's; below capture's"},
      {"lock_memory", &RealtimeConfig::lock_memory, 0, 0,
       "Keep the arena out of the way of swapping"},
      {"required", &RealtimeConfig::required, 0, 0,
       "Refuse to start where the kernel grants less; else say it and run"},
  };
};

struct Config {
  MissionConfig mission;
  InputConfig input;
  CameraConfig camera;
  BodyConfig body;
  AgentConfig agent;
  DdsConfig dds;
  RadioConfig radio;
  SecurityConfig security;
  SyncConfig exchange;
  ControlConfig control;
  JournalConfig journal;
  RecorderConfig recorder;
  RealtimeConfig realtime;
  GpioConfig gpio;
  GrayConfig gray;
  Ros2Config ros2;
  AutopilotConfig autopilot;
};

}  // namespace maplet::daemon
