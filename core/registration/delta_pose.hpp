// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/base/clock.hpp"
#include "core/geometry/planar_motion.hpp"
#include "core/geometry/se3.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet {

struct MapletA;  ///< frame: the first maplet of a pair
struct MapletB;  ///< frame: the second

/// The relation of two maplets: what the radio carries first and the skeleton is made of.
struct DeltaPose {
  enum class Kind : std::uint8_t {
    kConsecutive,  ///< b follows a on one agent's path
    kClosure,      ///< a place seen again
  };

  Kind kind = Kind::kConsecutive;
  MapletKey a;
  MapletKey b;
  Stamp stamp_a{};  ///< of a's origin
  Stamp stamp_b{};
  Transform<MapletA, MapletB> T_a_b;
  Matrix6d covariance = Matrix6d::Zero();  ///< tangent [rho; theta] of b; m^2, rad^2
  float overlap = 0.0F;                    ///< share of the smaller maplet's area matched, 0..1
  std::uint16_t matches = 0;               ///< plane pairs
  /// The motion is held in this plane, of both frames: three numbers and their covariance say it
  /// all (PlanarMotion).
  PlaneCode plane = PlaneCode::kSpace;
};

/// A turn known worse than this holds nothing: to whoever adds up small errors it says nothing, and
/// rooms look alike in steps of a quarter turn. Such a delta-pose tells of a gap; what lies on both
/// sides of it is side by side until a closure joins it.
[[nodiscard]] inline bool loose(const Matrix6d& covariance) noexcept {
  constexpr double kLooseRad = 0.5;
  return !(covariance.diagonal().tail<3>().maxCoeff() < kLooseRad * kLooseRad);
}

}  // namespace maplet
