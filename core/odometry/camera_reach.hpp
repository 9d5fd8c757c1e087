// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/odometry/odometry_config.hpp"

namespace maplet {

/// Whether the fastest camera could have moved by this in dt_s: m, rad, s. A jolt of 5 cm and
/// 0.15 rad is free.
[[nodiscard]] inline bool within_reach(double moved_m, double turned_rad, double dt_s,
                                       const OdometryConfig& config) noexcept {
  constexpr double kJoltM = 0.05;
  constexpr double kJoltRad = 0.15;
  // Written so that NaN fails.
  return moved_m < kJoltM + config.max_speed_mps * dt_s &&
         turned_rad < kJoltRad + config.max_turn_radps * dt_s;
}

}  // namespace maplet
