// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/space.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

Se3 SpatialSpace::compose(const Se3& a, const Se3& b) noexcept { return a * b; }

Se3 SpatialSpace::between(const Se3& a, const Se3& b) noexcept {
  // Both are of length 1: no normalising here, compose does.
  const Eigen::Quaterniond qi = a.q.conjugate();
  return {qi * b.q, qi * (b.t - a.t)};
}

Se3 SpatialSpace::retract(const Se3& a, const Vector6d& xi) noexcept { return a * Se3::exp(xi); }

namespace {

/// k with SO(3)'s inverse Jacobian I -+ 1/2 [p]x + k [p]x^2, a2 = |p|^2.
double inverse_jacobian_coefficient(double a2) noexcept {
  if (a2 < 0.01) {
    return 1.0 / 12.0 + a2 * (1.0 / 720.0 + a2 * (1.0 / 30240.0 + a2 * (1.0 / 1209600.0)));
  }
  const double a = std::sqrt(a2);
  return (1.0 - 0.5 * a * std::sin(a) / (1.0 - std::cos(a))) / a2;
}

}  // namespace

Vector6d SpatialSpace::error(const Se3& z, const Se3& rel) noexcept {
  // log of z^-1 rel by cross products, without SO(3)'s matrices.
  const Se3 d = between(z, rel);
  const double sign = d.q.w() < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * d.q.vec();
  const double n2 = v.squaredNorm();
  double scale;  // angle / sin(angle / 2)
  if (n2 < 1e-3) {
    scale = 2.0 *
            (1.0 + n2 * (1.0 / 6.0 + n2 * (3.0 / 40.0 + n2 * (5.0 / 112.0 + n2 * 35.0 / 1152.0))));
  } else {
    const double n = std::sqrt(n2);
    scale = 2.0 * std::atan2(n, sign * d.q.w()) / n;
  }
  const Eigen::Vector3d theta = scale * v;
  const Eigen::Vector3d cross = theta.cross(d.t);
  Vector6d e;
  e << d.t - 0.5 * cross + inverse_jacobian_coefficient(theta.squaredNorm()) * theta.cross(cross),
      theta;
  return e;
}

namespace {

// Below this angle^2 the inverse right Jacobian is 1 + ad/2 + ad^2/12: what follows is 1e-11 of it.
constexpr double kSmall = 1e-4;

}  // namespace

void SpatialSpace::jacobians(const Se3& /*z*/, const Se3& rel, const Vector6d& e, Matrix6d& by_a,
                             Matrix6d& by_b) noexcept {
  const Eigen::Vector3d rho = e.head<3>();
  const Eigen::Vector3d theta = e.tail<3>();
  if (theta.squaredNorm() < kSmall) {
    Eigen::Matrix3d k = 0.5 * skew(theta);
    k.noalias() += theta * (theta / 12.0).transpose();
    k.diagonal().array() += 1.0 - theta.squaredNorm() / 12.0;
    Eigen::Matrix3d right = 0.5 * skew(rho);
    right.noalias() += rho * (theta / 12.0).transpose();
    right.noalias() += theta * (rho / 12.0).transpose();
    right.diagonal().array() -= theta.dot(rho) / 6.0;
    by_b.topLeftCorner<3, 3>() = by_b.bottomRightCorner<3, 3>() = k;
    by_b.topRightCorner<3, 3>() = right;
    by_b.bottomLeftCorner<3, 3>().setZero();
  } else {
    by_b = right_jacobian_inverse(e);
  }
  // by_a = -by_b Ad(rel^-1), with Ad(rel^-1) = [R^T, -R^T [t]x; 0, R^T].
  const Eigen::Matrix3d back = rel.rotation().transpose();
  const Eigen::Matrix3d turn = -(by_b.topLeftCorner<3, 3>() * back);
  by_a.topLeftCorner<3, 3>() = by_a.bottomRightCorner<3, 3>() = turn;
  by_a.topRightCorner<3, 3>().noalias() = -turn * skew(rel.t);
  by_a.topRightCorner<3, 3>().noalias() -= by_b.topRightCorner<3, 3>() * back;
  by_a.bottomLeftCorner<3, 3>().setZero();
}

namespace {

// Products with SE(3)'s inverse right Jacobian without its matrices:
// Jr^-1 = [K, -K Q K; 0, K], K the inverse left Jacobian of SO(3) at -theta, Q at (-rho, -theta).
struct InverseRightJacobian {
  using Vector3 = Eigen::Vector3d;

  explicit InverseRightJacobian(const Vector6d& xi) noexcept : r{-xi.head<3>()}, p{-xi.tail<3>()} {
    const double a2 = p.squaredNorm();
    k2 = inverse_jacobian_coefficient(a2);
    small = a2 < kSmall;
    if (small) return;
    if (a2 < 0.01) {
      c1 = 1.0 / 6.0 - a2 * (1.0 / 120.0 - a2 * (1.0 / 5040.0 - a2 / 362880.0));
      c2 = 1.0 / 24.0 - a2 * (1.0 / 720.0 - a2 * (1.0 / 40320.0 - a2 / 3628800.0));
      c3 = 1.0 / 120.0 - a2 * (1.0 / 2520.0 - a2 * (1.0 / 120960.0 - a2 / 9979200.0));
      return;
    }
    const double a = std::sqrt(a2);
    const double s = std::sin(a);
    const double c = std::cos(a);
    c1 = (a - s) / (a2 * a);
    c2 = (a2 + 2.0 * c - 2.0) / (2.0 * a2 * a2);
    c3 = (2.0 * a - 3.0 * s + a * c) / (2.0 * a2 * a2 * a);
  }
  /// -K Q K x; transposed with sign = -1. kx: k(x, sign)
  [[nodiscard]] Vector3 right(const Vector3& x, const Vector3& kx, double sign) const noexcept {
    if (!small) return -k(q(kx, sign), sign);
    const Vector3 rx = r.cross(x);
    return -0.5 * sign * rx + (p.cross(rx) + r.cross(p.cross(x))) / 12.0;
  }
  /// K x; transposed with sign = -1.
  [[nodiscard]] Vector3 k(const Vector3& x, double sign) const noexcept {
    const Vector3 px = p.cross(x);
    return x - 0.5 * sign * px + k2 * p.cross(px);
  }
  /// Q x; transposed with sign = -1: every product of n cross matrices changes sign n times and its
  /// order, and Q's terms come in pairs of both orders.
  [[nodiscard]] Vector3 q(const Vector3& x, double sign) const noexcept {
    const Vector3 px = p.cross(x);
    const Vector3 rx = r.cross(x);
    const Vector3 ppx = p.cross(px);
    const Vector3 prx = p.cross(rx);
    const Vector3 rpx = r.cross(px);
    const Vector3 prpx = p.cross(rpx);
    return sign * 0.5 * rx + c1 * (prx + rpx + sign * prpx) +
           c2 * (sign * (p.cross(prx) + r.cross(ppx)) - sign * 3.0 * prpx) +
           c3 * (p.cross(r.cross(ppx)) + p.cross(prpx));
  }

  Vector3 r, p;
  bool small;
  double k2, c1, c2, c3;
};

}  // namespace

void SpatialSpace::pull_back(const Se3& /*z*/, const Se3& rel, const Vector6d& e, const Vector6d& v,
                             Vector6d& grad_a, Vector6d& grad_b) noexcept {
  const InverseRightJacobian j{e};
  const Eigen::Vector3d force = v.head<3>();
  const Eigen::Vector3d f = j.k(force, -1.0);
  const Eigen::Vector3d m = j.k(v.tail<3>(), -1.0) + j.right(force, f, -1.0);
  grad_b << f, m;
  // grad_a = -Ad(rel^-1)^T grad_b, with Ad(rel^-1) = [R^T, -R^T [t]x; 0, R^T].
  const Eigen::Matrix3d rotation = rel.rotation();
  const Eigen::Vector3d rf = rotation * f;
  grad_a.head<3>() = -rf;
  grad_a.tail<3>() = -(rel.t.cross(rf) + rotation * m);
}

Vector6d SpatialSpace::push_forward(const Se3& /*z*/, const Se3& rel, const Vector6d& e,
                                    const Vector6d& xi_a, const Vector6d& xi_b) noexcept {
  const Eigen::Matrix3d inverse = rel.rotation().transpose();
  const Eigen::Vector3d theta = xi_b.tail<3>() - inverse * xi_a.tail<3>();
  const Eigen::Vector3d rho =
      xi_b.head<3>() - inverse * (xi_a.head<3>() - rel.t.cross(xi_a.tail<3>()));
  const InverseRightJacobian j{e};
  const Eigen::Vector3d turned = j.k(theta, 1.0);
  Vector6d out;
  out << j.k(rho, 1.0) + j.right(theta, turned, 1.0), turned;
  return out;
}

double SpatialSpace::staleness(const Se3& now, const Se3& then) noexcept {
  // |q1 - q2| is half the angle between them.
  const double apart = std::min((then.q.coeffs() - now.q.coeffs()).squaredNorm(),
                                (then.q.coeffs() + now.q.coeffs()).squaredNorm());
  return 2.0 * std::sqrt(apart) + (now.t - then.t).norm() / (then.t.norm() + 0.1);
}

bool SpatialSpace::finite(const Se3& a) noexcept {
  return std::isfinite(a.t.sum() + a.q.coeffs().sum());
}

}  // namespace maplet
