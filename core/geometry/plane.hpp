// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "core/geometry/se3.hpp"

namespace maplet {

/// n . x + d = 0 with |n| = 1.
///
/// In a camera's frame d > 0: the normal points to the camera. In a maplet d has either sign and n
/// keeps the side that was seen; nobody re-normalises it.
/// Units   d in metres.
struct Plane {
  Eigen::Vector3d n = Eigen::Vector3d::UnitZ();
  double d = 0.0;

  [[nodiscard]] double distance(const Eigen::Vector3d& p) const noexcept { return n.dot(p) + d; }

  /// From the inverse-depth form theta (1/m), theta . (x/Z, y/Z, 1) = 1/Z, of a camera's frame.
  [[nodiscard]] static Plane from_theta(const Eigen::Vector3d& theta) noexcept {
    const double norm = theta.norm();
    return {-theta / norm, 1.0 / norm};
  }
  /// Only for d > 0.
  [[nodiscard]] Eigen::Vector3d theta() const noexcept { return -n / d; }
};

/// The same plane seen from a: n_a = R n_b, d_a = d_b - n_a . t (paper: T^-T pi).
[[nodiscard]] inline Plane operator*(const Se3& T_a_b, const Plane& b) noexcept {
  const Eigen::Vector3d n = T_a_b.q * b.n;
  return {n, b.d - n.dot(T_a_b.t)};
}

}  // namespace maplet
