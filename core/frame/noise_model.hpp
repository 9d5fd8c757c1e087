// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace maplet {

/// How far a sensor's depth is off, as standard deviation of inverse depth, 1/m.
///
/// Structured light and stereo measure disparity: sigma_z = k z^2, so sigma(1/Z) = k everywhere
/// (Khoshelham and Elberink 2012: k = 1.425e-3 1/m for Kinect v1). Time of flight:
/// sigma_z = floor_m + slope z, so sigma(1/Z) = (floor_m + slope z) / z^2.
struct NoiseModel {
  enum class Kind : std::uint8_t { kDisparity, kTimeOfFlight };

  Kind kind = Kind::kDisparity;
  double disparity_k = 1.425e-3;  ///< 1/m
  double tof_floor_m = 0.004;
  double tof_slope = 0.002;
  /// Noise of neighbouring pixels is correlated: this many pixels tell as much as one independent
  /// one. Covariances are multiplied by it.
  double correlated_px = 4.0;
  /// A pixel's depth is read this far beside it (standard deviation in either direction): noise of
  /// depth where a surface is slanted (Nguyen et al. 2012, Handa et al. 2014).
  double lateral_px = 0.5;
  /// Disparity comes in steps of this much 1/Z, 1/m (Kinect v1: 1/8 px at 580 px * 75 mm); 0: in
  /// none that matter.
  double disparity_step = 2.87e-3;

  [[nodiscard]] double sigma_inverse_depth(double inverse_depth) const noexcept {
    if (kind == Kind::kDisparity) return disparity_k;
    const double z = 1.0 / inverse_depth;
    return (tof_floor_m + tof_slope * z) * inverse_depth * inverse_depth;
  }
  [[nodiscard]] double sigma_depth_m(double depth_m) const noexcept {
    return sigma_inverse_depth(1.0 / depth_m) * depth_m * depth_m;
  }
};

}  // namespace maplet
