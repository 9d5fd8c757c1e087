// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "core/base/field.hpp"

namespace maplet {

/// Section [odometry] of the configuration.
struct OdometryConfig {
  // Alignment.
  int references = 2;
  int coarse_patches = 160;
  int max_patches = 1024;
  int max_iterations = 12;
  double gate_rad = 0.5;
  double gate_chi2 = 40.0;
  double saturation_px = 60.0;
  double noise_scale = 1.5;
  // Motion prior.
  double prior_acceleration_mps2 = 5.0;
  double prior_angular_acceleration_radps2 = 30.0;
  bool gray = true;
  double external_share = 0.05;
  double gyro_share = 0.02;
  // What counts as free, and as lost.
  double free_m = 0.05;
  double free_rad = 0.05;
  int min_pairs = 20;
  double min_overlap = 0.25;
  int lost_frames = 5;
  double max_speed_mps = 3.0;
  double max_turn_radps = 6.0;
  // When a keyframe is due.
  double keyframe_overlap = 0.5;
  double keyframe_distance_m = 0.20;
  double keyframe_rad = 0.30;
  double keyframe_entropy = 1.0;

  static constexpr Field<OdometryConfig> kFields[] = {
      {"references", &OdometryConfig::references, 1, 2,
       "Keyframes that a frame is aligned to at once"},
      {"coarse_patches", &OdometryConfig::coarse_patches, 16, 2048,
       "Largest patches that the coarse iterations use"},
      {"max_patches", &OdometryConfig::max_patches, 32, 2048,
       "Largest patches that the fine iterations use"},
      {"max_iterations", &OdometryConfig::max_iterations, 2, 100, "Gauss-Newton steps per start"},
      {"gate_rad", &OdometryConfig::gate_rad, 0.05, 1.5,
       "Patches whose normals differ by more are not paired"},
      {"gate_chi2", &OdometryConfig::gate_chi2, 3.0, 1e4,
       "Pairs whose squared Mahalanobis distance (3 degrees of freedom) is larger are outliers"},
      {"saturation_px", &OdometryConfig::saturation_px, 1.0, 1e6,
       "A patch never tells more than this many pixels would: what is left is the sensor's bias"},
      {"noise_scale", &OdometryConfig::noise_scale, 0.1, 100.0,
       "Standard deviations of the odometry are multiplied by it: calibrated on true motion"},
      {"prior_acceleration_mps2", &OdometryConfig::prior_acceleration_mps2, 0.01, 100.0,
       "How fast the velocity is expected to change"},
      {"prior_angular_acceleration_radps2", &OdometryConfig::prior_angular_acceleration_radps2,
       0.01, 1000.0, "How fast the rate of turn is expected to change"},
      {"gray", &OdometryConfig::gray, 0, 1,
       "Intensities take part where there is a gray image of known viewpoint"},
      {"external_share", &OdometryConfig::external_share, 0.001, 10.0,
       "External odometry is wrong by this share of each step, where it does not say"},
      {"gyro_share", &OdometryConfig::gyro_share, 0.001, 10.0,
       "A gyro's turn is wrong by this share"},
      {"free_m", &OdometryConfig::free_m, 1e-4, 1.0,
       "A translation known worse than this from one frame counts as free"},
      {"free_rad", &OdometryConfig::free_rad, 1e-4, 1.0,
       "A rotation known worse than this from one frame counts as free"},
      {"min_pairs", &OdometryConfig::min_pairs, 3, 1000, "Fewer inlying patches mean lost"},
      {"min_overlap", &OdometryConfig::min_overlap, 0.01, 0.9,
       "A smaller share of the patches' pixels on inliers means lost"},
      {"lost_frames", &OdometryConfig::lost_frames, 1, 1000,
       "Usable frames without success after which a new segment begins"},
      {"max_speed_mps", &OdometryConfig::max_speed_mps, 0.1, 100.0,
       "No camera is carried faster: a pose that says so means lost"},
      {"max_turn_radps", &OdometryConfig::max_turn_radps, 0.1, 100.0,
       "No camera is turned faster: a pose that says so means lost"},
      {"keyframe_overlap", &OdometryConfig::keyframe_overlap, 0.05, 0.99,
       "A keyframe is due when the overlap with the last one falls below"},
      {"keyframe_distance_m", &OdometryConfig::keyframe_distance_m, 0.01, 10.0,
       "A keyframe is due after this way"},
      {"keyframe_rad", &OdometryConfig::keyframe_rad, 0.01, 3.0,
       "A keyframe is due after this rotation"},
      {"keyframe_entropy", &OdometryConfig::keyframe_entropy, 0.05, 10.0,
       "A keyframe is due when the pose's entropy per degree of freedom grew by this, in nats"},
  };
};

/// Of a frame's patches, as many are kept as the fine iterations use.
[[nodiscard]] constexpr std::size_t facets_of(const OdometryConfig& config) noexcept {
  return static_cast<std::size_t>(config.max_patches);
}

}  // namespace maplet
