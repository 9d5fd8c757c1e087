// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/geometry/se3.hpp"

#include <cmath>

namespace maplet {

namespace {

constexpr double kSmallAngle = 1e-5;

// V with exp([rho; theta]).t = V rho (left Jacobian of SO(3)).
Eigen::Matrix3d so3_left_jacobian(const Eigen::Vector3d& theta) noexcept {
  const double a = theta.norm();
  const Eigen::Matrix3d k = skew(theta);
  if (a < kSmallAngle) return Eigen::Matrix3d::Identity() + 0.5 * k + k * k / 6.0;
  const double a2 = a * a;
  return Eigen::Matrix3d::Identity() + (1.0 - std::cos(a)) / a2 * k +
         (a - std::sin(a)) / (a2 * a) * k * k;
}

Eigen::Matrix3d so3_left_jacobian_inverse(const Eigen::Vector3d& theta) noexcept {
  const double a = theta.norm();
  const Eigen::Matrix3d k = skew(theta);
  if (a < kSmallAngle) return Eigen::Matrix3d::Identity() - 0.5 * k + k * k / 12.0;
  const double half = 0.5 * a;
  const double c = (1.0 - half * std::cos(half) / std::sin(half)) / (a * a);
  return Eigen::Matrix3d::Identity() - 0.5 * k + c * k * k;
}

Eigen::Quaterniond so3_exp(const Eigen::Vector3d& theta) noexcept {
  const double a = theta.norm();
  const double half = 0.5 * a;
  const double s = a < kSmallAngle ? 0.5 - a * a / 48.0 : std::sin(half) / a;
  return {std::cos(half), s * theta.x(), s * theta.y(), s * theta.z()};
}

Eigen::Vector3d so3_log(const Eigen::Quaterniond& q) noexcept {
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * q.vec();
  const double n = v.norm();
  if (n < kSmallAngle) return 2.0 * v;
  return 2.0 * std::atan2(n, sign * q.w()) / n * v;
}

// The off-diagonal block Q of SE(3)'s left Jacobian (Barfoot, State Estimation for Robotics, 7.86).
Eigen::Matrix3d left_jacobian_q(const Eigen::Vector3d& rho, const Eigen::Vector3d& theta) noexcept {
  const double a = theta.norm();
  const double a2 = a * a;
  double c1, c2, c3;
  if (a < 1e-2) {
    c1 = 1.0 / 6.0 - a2 / 120.0;
    c2 = 1.0 / 24.0 - a2 / 720.0;
    c3 = 1.0 / 120.0 - a2 / 2520.0;
  } else {
    const double s = std::sin(a);
    const double c = std::cos(a);
    c1 = (a - s) / (a2 * a);
    c2 = (a2 + 2.0 * c - 2.0) / (2.0 * a2 * a2);
    c3 = (2.0 * a - 3.0 * s + a * c) / (2.0 * a2 * a2 * a);
  }
  const Eigen::Matrix3d r = skew(rho);
  const Eigen::Matrix3d p = skew(theta);
  return 0.5 * r + c1 * (p * r + r * p + p * r * p) +
         c2 * (p * p * r + r * p * p - 3.0 * p * r * p) + c3 * (p * r * p * p + p * p * r * p);
}

}  // namespace

Eigen::Matrix3d skew(const Eigen::Vector3d& v) noexcept {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Se3 Se3::exp(const Vector6d& xi) noexcept {
  const Eigen::Vector3d theta = xi.tail<3>();
  return {so3_exp(theta), so3_left_jacobian(theta) * xi.head<3>()};
}

Vector6d Se3::log() const noexcept {
  const Eigen::Vector3d theta = so3_log(q);
  Vector6d xi;
  xi << so3_left_jacobian_inverse(theta) * t, theta;
  return xi;
}

Se3 Se3::inverse() const noexcept {
  const Eigen::Quaterniond qi = q.conjugate();
  return {qi, -(qi * t)};
}

Matrix6d Se3::adjoint() const noexcept {
  const Eigen::Matrix3d r = rotation();
  Matrix6d ad = Matrix6d::Zero();
  ad.topLeftCorner<3, 3>() = r;
  ad.topRightCorner<3, 3>() = skew(t) * r;
  ad.bottomRightCorner<3, 3>() = r;
  return ad;
}

double Se3::angle() const noexcept { return so3_log(q).norm(); }

Se3 operator*(const Se3& a, const Se3& b) noexcept {
  return {(a.q * b.q).normalized(), a.q * b.t + a.t};
}

Eigen::Vector3d operator*(const Se3& a, const Eigen::Vector3d& p) noexcept { return a.q * p + a.t; }

Matrix6d right_jacobian_inverse(const Vector6d& xi) noexcept {
  // Jr(xi) = Jl(-xi); the inverse of [[J Q] [0 J]] is [[J^-1, -J^-1 Q J^-1] [0 J^-1]].
  const Eigen::Vector3d rho = -xi.head<3>();
  const Eigen::Vector3d theta = -xi.tail<3>();
  const Eigen::Matrix3d j = so3_left_jacobian_inverse(theta);
  Matrix6d out = Matrix6d::Zero();
  out.topLeftCorner<3, 3>() = j;
  out.topRightCorner<3, 3>() = -j * left_jacobian_q(rho, theta) * j;
  out.bottomRightCorner<3, 3>() = j;
  return out;
}

}  // namespace maplet
