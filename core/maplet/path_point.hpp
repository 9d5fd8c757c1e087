// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/clock.hpp"
#include "core/geometry/se3.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet {

/// A moment on the path, in the frame of the maplet that was under construction: what a
/// measurement of that moment is tied to.
struct PathPoint {
  MapletKey maplet;
  Stamp stamp{};         ///< of the moment
  Stamp stamp_maplet{};  ///< of the maplet's origin
  Transform<MapletFrame, CameraFrame> T_maplet_camera;
  Matrix6d covariance = Matrix6d::Zero();  ///< tangent of camera; m^2, rad^2
};

/// A range to another agent, with its bearing when that was measured, too.
struct RangeMeasurement {
  double range_m = 0.0;
  double sigma_m = 0.0;
  Eigen::Vector3d bearing = Eigen::Vector3d::Zero();  ///< unit, camera's frame; zero: not known
  double bearing_sigma_rad = 0.0;
};

/// The same range as it would have been measured at the maplet's origin.
struct CarriedRange {
  MapletKey maplet;
  double range_m = 0.0;
  double sigma_m = 0.0;
};

/// Carries a range to the origin of its maplet. At an origin nothing changes. Elsewhere the way
/// from there counts: along a known bearing with the covariance of path and bearing; in a direction
/// that is not known as if all were equally likely.
///
/// Math  docs/math/maplet.md, eq. 9-10.
[[nodiscard]] CarriedRange carry_to_origin(const PathPoint& at,
                                           const RangeMeasurement& measured) noexcept;

}  // namespace maplet
