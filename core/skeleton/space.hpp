// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "core/geometry/se3.hpp"

namespace maplet {

/// A pose in the plane; the rotation as a unit complex number, so that composing needs no sine.
struct Se2 {
  double x = 0.0;
  double y = 0.0;
  double c = 1.0;
  double s = 0.0;

  [[nodiscard]] static Se2 from(double x, double y, double theta) noexcept;
  [[nodiscard]] double angle() const noexcept;
};

/// A Space gives the solver its group: poses, the error of a measured relative pose and its exact
/// Jacobians. Both use right perturbations, so a factor's Jacobians depend on the relative pose
/// alone: moving a whole part of the graph rigidly leaves its linearisation exact.
///
/// Math   docs/math/skeleton.md, eq. 2-5.
struct PlanarSpace {
  static constexpr int kDim = 3;
  static constexpr int kPoint = 2;  ///< coordinates of a point; the first of a tangent
  using Pose = Se2;
  using Tangent = Eigen::Matrix<double, 3, 1>;
  using Block = Eigen::Matrix<double, 3, 3>;

  [[nodiscard]] static Pose compose(const Pose& a, const Pose& b) noexcept;
  [[nodiscard]] static Pose between(const Pose& a, const Pose& b) noexcept;  ///< a^-1 b
  [[nodiscard]] static Pose retract(const Pose& a, const Tangent& xi) noexcept;
  /// (x, y, theta) of z^-1 rel.
  [[nodiscard]] static Tangent error(const Pose& z, const Pose& rel) noexcept;
  /// Derivatives of error(z, a^-1 b) by right perturbations of a and b, at a^-1 b = rel.
  static void jacobians(const Pose& z, const Pose& rel, const Tangent& e, Block& by_a,
                        Block& by_b) noexcept;
  /// grad_a = by_a^T v, grad_b = by_b^T v, without forming the Jacobians where that is cheaper.
  static void pull_back(const Pose& z, const Pose& rel, const Tangent& e, const Tangent& v,
                        Tangent& grad_a, Tangent& grad_b) noexcept;
  /// by_a * xi_a + by_b * xi_b: how the error changes.
  [[nodiscard]] static Tangent push_forward(const Pose& z, const Pose& rel, const Tangent& e,
                                            const Tangent& xi_a, const Tangent& xi_b) noexcept;
  /// How far two relative poses are apart for a linearisation: rad, and m per m of lever.
  [[nodiscard]] static double staleness(const Pose& now, const Pose& then) noexcept;
  [[nodiscard]] static bool finite(const Pose& a) noexcept;
};

/// As PlanarSpace, with the full logarithm of SE(3) as error.
struct SpatialSpace {
  static constexpr int kDim = 6;
  static constexpr int kPoint = 3;
  using Pose = Se3;
  using Tangent = Vector6d;
  using Block = Matrix6d;

  [[nodiscard]] static Pose compose(const Pose& a, const Pose& b) noexcept;
  [[nodiscard]] static Pose between(const Pose& a, const Pose& b) noexcept;
  [[nodiscard]] static Pose retract(const Pose& a, const Tangent& xi) noexcept;
  [[nodiscard]] static Tangent error(const Pose& z, const Pose& rel) noexcept;
  static void jacobians(const Pose& z, const Pose& rel, const Tangent& e, Block& by_a,
                        Block& by_b) noexcept;
  static void pull_back(const Pose& z, const Pose& rel, const Tangent& e, const Tangent& v,
                        Tangent& grad_a, Tangent& grad_b) noexcept;
  /// by_a * xi_a + by_b * xi_b: how the error changes.
  [[nodiscard]] static Tangent push_forward(const Pose& z, const Pose& rel, const Tangent& e,
                                            const Tangent& xi_a, const Tangent& xi_b) noexcept;
  [[nodiscard]] static double staleness(const Pose& now, const Pose& then) noexcept;
  [[nodiscard]] static bool finite(const Pose& a) noexcept;
};

}  // namespace maplet
