// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/geometry/plane.hpp"
#include "core/maplet/maplet.hpp"
#include "core/maplet/plane_tangent.hpp"

namespace maplet {

/// One keyframe's view of a plane, carried into the maplet's frame.
struct PlaneSighting {
  Plane plane;                          ///< maplet's frame
  PlaneTangent tangent;                 ///< of `plane`, maplet's frame
  Eigen::Matrix3d covariance;           ///< of its tangent: sensor and keyframe pose
  Eigen::Matrix3d sensor;               ///< of its tangent: sensor alone
  Eigen::Matrix<double, 3, 6> by_pose;  ///< d tangent / d xi of the keyframe's pose
  double area_m2 = 0.0;
  float mean_gray = -1.0F;
};

/// A plane of the maplet under construction: the weighted mean of its sightings.
///
/// Math   docs/math/maplet.md, eq. 3-5.
struct FusedPlane {
  std::uint32_t serial = 0;  ///< of its tiles; never used twice
  std::int32_t first_tile = -1;
  std::uint32_t touched = 0;  ///< cells
  std::uint32_t last_keyframe = 0;
  std::uint16_t observations = 0;
  Plane plane;
  PlaneTangent tangent;           ///< of `plane`
  Eigen::Matrix3d information;    ///< of the tangent
  double scatter = 0.0;           ///< sum of its sightings' squared normalised offsets, bounded
  std::uint32_t scattered = 0;    ///< degrees of freedom of that
  PlaneBasis anchor{Plane{}, 0};  ///< of its cells: fixed while the plane settles
  std::uint8_t axis = 0;          ///< of `anchor`
  std::uint64_t points = 0;       ///< depth pixels that were placed on it
  double gray_sum = 0.0;
  double gray_area_m2 = 0.0;

  void start(const PlaneSighting& first, std::uint32_t serial_number,
             std::uint32_t keyframe) noexcept;
  /// Squared normalised distance of a sighting, 3 degrees of freedom; infinite when it is out of
  /// the gates.
  [[nodiscard]] double distance(const PlaneSighting& sighting, double gate_m,
                                double gate_rad) const noexcept;
  void fuse(const PlaneSighting& sighting, std::uint32_t keyframe) noexcept;
  [[nodiscard]] Eigen::Matrix3d covariance() const noexcept { return information.inverse(); }
  /// The same as far as the sightings' own differences bear it out: what one keyframe's view is off
  /// by the next one's is, too, so that only kIndependent of them count as such. eq. 7
  [[nodiscard]] Eigen::Matrix3d honest_covariance() const noexcept;
};

}  // namespace maplet
