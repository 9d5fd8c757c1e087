// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "core/geometry/se3.hpp"
#include "core/registration/fixed_list.hpp"

namespace maplet {

/// What a set of planes says about a motion, direction by direction.
///
/// Math   docs/math/icap.md, eq. 9-11. Directions are taken about a pivot among the planes and with
///   angles times 1 m, so that metres and radians compare.
struct Observability {
  Matrix6d information = Matrix6d::Zero();      ///< cleaned: zero along free axes
  Matrix6d covariance = Matrix6d::Zero();       ///< zero along free axes
  Matrix6d free_covariance = Matrix6d::Zero();  ///< kFreeSigma along them
  Matrix6d step_inverse = Matrix6d::Zero();     ///< pseudo-inverse of the raw information
  FixedList<Vector6d, 6> free_axes;

  static constexpr double kFreeSigma = 10.0;  ///< m, and rad at 1 m

  /// @param raw       sum of J^T W J, tangent of b
  /// @param spurious  what noise in the planes' directions alone adds to it
  /// @param pivot     point of b's frame
  [[nodiscard]] static Observability of(const Matrix6d& raw, const Matrix6d& spurious,
                                        const Eigen::Vector3d& pivot, double free_sigma) noexcept;
};

}  // namespace maplet
