// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/space.hpp"

#include <cmath>

namespace maplet {

Se2 Se2::from(double x, double y, double theta) noexcept {
  return {x, y, std::cos(theta), std::sin(theta)};
}

double Se2::angle() const noexcept { return std::atan2(s, c); }

Se2 PlanarSpace::compose(const Se2& a, const Se2& b) noexcept {
  Se2 out{a.x + a.c * b.x - a.s * b.y, a.y + a.s * b.x + a.c * b.y, a.c * b.c - a.s * b.s,
          a.s * b.c + a.c * b.s};
  const double scale = 1.5 - 0.5 * (out.c * out.c + out.s * out.s);  // one Newton step to length 1
  out.c *= scale;
  out.s *= scale;
  return out;
}

Se2 PlanarSpace::between(const Se2& a, const Se2& b) noexcept {
  const double dx = b.x - a.x;
  const double dy = b.y - a.y;
  return {a.c * dx + a.s * dy, a.c * dy - a.s * dx, a.c * b.c + a.s * b.s, a.c * b.s - a.s * b.c};
}

Se2 PlanarSpace::retract(const Se2& a, const Tangent& xi) noexcept {
  return compose(a, Se2::from(xi[0], xi[1], xi[2]));
}

PlanarSpace::Tangent PlanarSpace::error(const Se2& z, const Se2& rel) noexcept {
  const Se2 e = between(z, rel);
  return {e.x, e.y, e.angle()};
}

void PlanarSpace::jacobians(const Se2& z, const Se2& rel, const Tangent& /*e*/, Block& by_a,
                            Block& by_b) noexcept {
  const Se2 e = between(z, rel);
  by_b << e.c, -e.s, 0.0, e.s, e.c, 0.0, 0.0, 0.0, 1.0;
  // a's perturbation moves rel by -rho - theta x rel.t, seen from z.
  by_a << -z.c, -z.s, z.c * rel.y - z.s * rel.x, z.s, -z.c, -z.s * rel.y - z.c * rel.x, 0.0, 0.0,
      -1.0;
}

void PlanarSpace::pull_back(const Se2& z, const Se2& rel, const Tangent& /*e*/, const Tangent& v,
                            Tangent& grad_a, Tangent& grad_b) noexcept {
  const Se2 e = between(z, rel);
  grad_b = {e.c * v[0] + e.s * v[1], e.c * v[1] - e.s * v[0], v[2]};
  const double ux = z.c * v[0] - z.s * v[1];  // v's translation, turned into a's frame
  const double uy = z.s * v[0] + z.c * v[1];
  grad_a = {-ux, -uy, rel.y * ux - rel.x * uy - v[2]};
}

double PlanarSpace::staleness(const Se2& now, const Se2& then) noexcept {
  const Se2 d = between(then, now);
  const double lever = std::hypot(then.x, then.y) + 0.1;
  return std::abs(d.s) + (d.c < 0.0 ? 1.0 : 0.0) + std::hypot(d.x, d.y) / lever;
}

bool PlanarSpace::finite(const Se2& a) noexcept { return std::isfinite(a.x + a.y + a.c + a.s); }

Se3 SpatialSpace::compose(const Se3& a, const Se3& b) noexcept { return a * b; }

Se3 SpatialSpace::between(const Se3& a, const Se3& b) noexcept {
  const Eigen::Quaterniond qi = a.q.conjugate();
  return {(qi * b.q).normalized(), qi * (b.t - a.t)};
}

Se3 SpatialSpace::retract(const Se3& a, const Vector6d& xi) noexcept { return a * Se3::exp(xi); }

Vector6d SpatialSpace::error(const Se3& z, const Se3& rel) noexcept {
  return between(z, rel).log();
}

void SpatialSpace::jacobians(const Se3& /*z*/, const Se3& rel, const Vector6d& e, Matrix6d& by_a,
                             Matrix6d& by_b) noexcept {
  by_b = right_jacobian_inverse(e);
  by_a.noalias() = -by_b * rel.inverse().adjoint();
}

void SpatialSpace::pull_back(const Se3& /*z*/, const Se3& rel, const Vector6d& e, const Vector6d& v,
                             Vector6d& grad_a, Vector6d& grad_b) noexcept {
  grad_b.noalias() = right_jacobian_inverse(e).transpose() * v;
  // -Ad(rel^-1)^T grad_b, with Ad(rel^-1) = [R^T, -R^T [t]x; 0, R^T].
  const Eigen::Vector3d f = rel.q * grad_b.head<3>();
  const Eigen::Vector3d m = rel.q * grad_b.tail<3>();
  grad_a.head<3>() = -f;
  grad_a.tail<3>() = -(rel.t.cross(f) + m);
}

double SpatialSpace::staleness(const Se3& now, const Se3& then) noexcept {
  const double angle = 2.0 * (then.q.conjugate() * now.q).vec().norm();
  return angle + (now.t - then.t).norm() / (then.t.norm() + 0.1);
}

bool SpatialSpace::finite(const Se3& a) noexcept {
  return std::isfinite(a.t.sum() + a.q.coeffs().sum());
}

}  // namespace maplet
