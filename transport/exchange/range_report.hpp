// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "core/base/clock.hpp"

namespace maplet {

/// How far another agent is, as a program on this robot says: topic maplet/range.
struct RangeReport {
  std::uint16_t agent = 0;  ///< whose sensor it was
  std::uint16_t other = 0;
  Stamp stamp{};  ///< of the agent's frames' clock; 0: now
  float range_m = 0.0F;
  float sigma_m = 0.0F;
  std::array<float, 3> bearing{};  ///< unit, camera's frame; all 0: not measured
  float bearing_sigma_rad = 0.0F;
};

/// False when a report from outside makes no sense.
[[nodiscard]] inline bool valid(const RangeReport& r) noexcept {
  const float norm = std::hypot(r.bearing[0], r.bearing[1], r.bearing[2]);
  const bool bears =
      std::abs(norm - 1.0F) < 0.01F && r.bearing_sigma_rad > 0.0F && r.bearing_sigma_rad < 4.0F;
  return r.agent != r.other && r.range_m > 0.0F && r.range_m <= 10'000.0F && r.sigma_m > 0.0F &&
         r.sigma_m <= 60.0F && r.stamp >= Stamp{} && (norm == 0.0F || bears);
}

}  // namespace maplet
