// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>

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

// In the plane each of these is a dozen operations: calls would cost as much again.

inline Se2 Se2::from(double x, double y, double theta) noexcept {
  return {x, y, std::cos(theta), std::sin(theta)};
}

inline double Se2::angle() const noexcept { return std::atan2(s, c); }

inline Se2 PlanarSpace::compose(const Se2& a, const Se2& b) noexcept {
  Se2 out{a.x + a.c * b.x - a.s * b.y, a.y + a.s * b.x + a.c * b.y, a.c * b.c - a.s * b.s,
          a.s * b.c + a.c * b.s};
  const double scale = 1.5 - 0.5 * (out.c * out.c + out.s * out.s);  // one Newton step to length 1
  out.c *= scale;
  out.s *= scale;
  return out;
}

inline Se2 PlanarSpace::between(const Se2& a, const Se2& b) noexcept {
  const double dx = b.x - a.x;
  const double dy = b.y - a.y;
  return {a.c * dx + a.s * dy, a.c * dy - a.s * dx, a.c * b.c + a.s * b.s, a.c * b.s - a.s * b.c};
}

inline Se2 PlanarSpace::retract(const Se2& a, const Tangent& xi) noexcept {
  const double t2 = xi[2] * xi[2];
  if (!(t2 < 1e-3)) return compose(a, Se2::from(xi[0], xi[1], xi[2]));
  return compose(a, {xi[0], xi[1], 1.0 - t2 * (0.5 - t2 * (1.0 / 24.0 - t2 / 720.0)),
                     xi[2] * (1.0 - t2 * (1.0 / 6.0 - t2 * (1.0 / 120.0 - t2 / 5040.0)))});
}

inline PlanarSpace::Tangent PlanarSpace::error(const Se2& z, const Se2& rel) noexcept {
  const Se2 e = between(z, rel);
  const double s2 = e.s * e.s;
  if (e.c > 0.0 && s2 < 1e-3) {  // arcsin
    return {e.x, e.y,
            e.s * (1.0 +
                   s2 * (1.0 / 6.0 + s2 * (3.0 / 40.0 + s2 * (5.0 / 112.0 + s2 * 35.0 / 1152.0))))};
  }
  return {e.x, e.y, e.angle()};
}

inline void PlanarSpace::jacobians(const Se2& z, const Se2& rel, const Tangent& /*e*/, Block& by_a,
                                   Block& by_b) noexcept {
  const Se2 e = between(z, rel);
  by_b << e.c, -e.s, 0.0, e.s, e.c, 0.0, 0.0, 0.0, 1.0;
  // a's perturbation moves rel by -rho - theta x rel.t, seen from z.
  by_a << -z.c, -z.s, z.c * rel.y - z.s * rel.x, z.s, -z.c, -z.s * rel.y - z.c * rel.x, 0.0, 0.0,
      -1.0;
}

inline void PlanarSpace::pull_back(const Se2& z, const Se2& rel, const Tangent& /*e*/,
                                   const Tangent& v, Tangent& grad_a, Tangent& grad_b) noexcept {
  const Se2 e = between(z, rel);
  grad_b = {e.c * v[0] + e.s * v[1], e.c * v[1] - e.s * v[0], v[2]};
  const double ux = z.c * v[0] - z.s * v[1];  // v's translation, turned into a's frame
  const double uy = z.s * v[0] + z.c * v[1];
  grad_a = {-ux, -uy, rel.y * ux - rel.x * uy - v[2]};
}

inline PlanarSpace::Tangent PlanarSpace::push_forward(const Se2& z, const Se2& rel,
                                                      const Tangent& /*e*/, const Tangent& xi_a,
                                                      const Tangent& xi_b) noexcept {
  // In a's frame: b's end moves by R xi_b - rho_a - theta_a x t.
  const double ux = rel.c * xi_b[0] - rel.s * xi_b[1] - xi_a[0] + xi_a[2] * rel.y;
  const double uy = rel.s * xi_b[0] + rel.c * xi_b[1] - xi_a[1] - xi_a[2] * rel.x;
  return {z.c * ux + z.s * uy, z.c * uy - z.s * ux, xi_b[2] - xi_a[2]};
}

inline double PlanarSpace::staleness(const Se2& now, const Se2& then) noexcept {
  const Se2 d = between(then, now);
  const double lever = std::sqrt(then.x * then.x + then.y * then.y) + 0.1;
  return std::abs(d.s) + (d.c < 0.0 ? 1.0 : 0.0) + std::sqrt(d.x * d.x + d.y * d.y) / lever;
}

inline bool PlanarSpace::finite(const Se2& a) noexcept {
  return std::isfinite(a.x + a.y + a.c + a.s);
}

}  // namespace maplet
