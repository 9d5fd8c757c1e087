// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/field.hpp"
#include "core/limits.hpp"

namespace maplet {

/// How planes are fused into maplets and where maplets end. Section [maplet].
struct MapletConfig {
  int max_bytes = 8192;
  int max_keyframes = 20;
  int overlap_keyframes = 2;
  int boundary_keyframes = 1;
  double max_path_m = 3.0;
  double max_yaw_rad = 1.2;
  double max_curvature_rad = 3.0;
  double cell_m = 0.05;
  double min_area_m2 = 0.02;
  double gate_distance_m = 0.03;
  double gate_angle_rad = 0.2;
  double fit_m = 0.015;
  double max_free_share = 0.2;
  double floor_m = 0.001;
  double floor_rad = 0.001;
  double uneven_m = 0.004;
  double odometry_scale = 0.0;
  double odometry_floor_m = 0.0;
  double odometry_floor_rad = 0.0;

  static constexpr int kMaxOverlapKeyframes = 4;
  static constexpr int kMaxBoundaryKeyframes = 3;

  static constexpr Field<MapletConfig> kFields[] = {
      {"max_bytes", &MapletConfig::max_bytes, 1024, kMaxMapletBytes,
       "No encoded maplet is larger: the least informative planes go, or it is cut earlier"},
      {"max_keyframes", &MapletConfig::max_keyframes, 2, kMaxMapletKeyframes,
       "Keyframes in one maplet"},
      {"overlap_keyframes", &MapletConfig::overlap_keyframes, 1, kMaxOverlapKeyframes,
       "Keyframes that a maplet shares with the one before it"},
      {"boundary_keyframes", &MapletConfig::boundary_keyframes, 0, kMaxBoundaryKeyframes,
       "So many more or less where that puts the next origin in the open, among structure"},
      {"max_path_m", &MapletConfig::max_path_m, 0.1, 100.0,
       "A maplet ends when its path is this long"},
      {"max_yaw_rad", &MapletConfig::max_yaw_rad, 0.1, 6.3,
       "A maplet ends when the view has turned this far from its origin's"},
      {"max_curvature_rad", &MapletConfig::max_curvature_rad, 0.1, 100.0,
       "A maplet ends when its path has bent this much in all"},
      {"cell_m", &MapletConfig::cell_m, 0.02, 0.5,
       "Width of the cells that a plane's extent is made of"},
      {"min_area_m2", &MapletConfig::min_area_m2, 0.0, 1.0, "Smaller planes are left out"},
      {"gate_distance_m", &MapletConfig::gate_distance_m, 0.001, 0.5,
       "A plane further off the map's plane is another one"},
      {"gate_angle_rad", &MapletConfig::gate_angle_rad, 0.01, 1.0,
       "A plane more inclined to the map's plane is another one"},
      {"fit_m", &MapletConfig::fit_m, 0.002, 0.1,
       "A patch further off its plane is left out of the plane's extent"},
      {"max_free_share", &MapletConfig::max_free_share, 0.0, 1.0,
       "A cell that was seen through more often than this is left out"},
      {"floor_m", &MapletConfig::floor_m, 0.0, 0.1,
       "Standard deviation of a plane's offset that no averaging removes"},
      {"floor_rad", &MapletConfig::floor_rad, 0.0, 0.1,
       "Standard deviation of a plane's direction that no averaging removes"},
      {"uneven_m", &MapletConfig::uneven_m, 0.0, 0.1,
       "What a surface differs by from one view to another, when keyframes are refined"},
      {"odometry_scale", &MapletConfig::odometry_scale, 0.0, 100.0,
       "Factor on the odometry's standard deviations when keyframes are refined; 0 and floors of 0 "
       "leave them as tracked"},
      {"odometry_floor_m", &MapletConfig::odometry_floor_m, 0.0, 1.0,
       "Added to that: what the odometry may be off from one keyframe to the next"},
      {"odometry_floor_rad", &MapletConfig::odometry_floor_rad, 0.0, 1.0, "The same, turned"},
  };
};

}  // namespace maplet
