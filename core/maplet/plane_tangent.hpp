// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "core/geometry/plane.hpp"
#include "core/geometry/se3.hpp"

namespace maplet {

/// Small changes (alpha, beta, h) of a plane about one of its points: eq. 2 of docs/math/maplet.md.
/// Local, so that turning and shifting hardly mix and no lever arm to the frame's origin enters.
///
/// Units   rad, rad, m. Any frame: moving everything rigidly changes nothing.
struct PlaneTangent {
  Eigen::Vector3d u, v, n, centre;

  /// The tangent of a nearby plane of the same frame.
  [[nodiscard]] Eigen::Vector3d of(const Plane& plane) const noexcept {
    return {u.dot(plane.n), v.dot(plane.n), plane.distance(centre)};
  }
  /// The plane at a tangent.
  [[nodiscard]] Plane at(const Eigen::Vector3d& delta) const noexcept;
  /// The same plane's tangent about another point and other axes in it: delta_to = A delta_this.
  [[nodiscard]] Eigen::Matrix3d change_to(const PlaneTangent& to) const noexcept;
  /// d delta / d xi when the plane is carried along by T exp(xi), this being in T's source frame.
  [[nodiscard]] Eigen::Matrix<double, 3, 6> jacobian_of_motion() const noexcept;
  /// d delta / d theta of a camera's plane theta, this being in the camera's frame.
  [[nodiscard]] Eigen::Matrix3d jacobian_of_theta(const Plane& plane) const noexcept;
  [[nodiscard]] PlaneTangent moved(const Se3& T) const noexcept {
    return {T.q * u, T.q * v, T.q * n, T * centre};
  }
};

}  // namespace maplet
