// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/geometry/planar_motion.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/geometry/direction_code.hpp"

namespace maplet {

namespace {

constexpr std::uint32_t kNoDirection = 0x80008000U;  // no direction has this code

PlaneCode code_of(const Eigen::Vector3d& up) noexcept {
  return PlaneCode{pack_direction(up) ^ kNoDirection};
}

Eigen::Vector3d up_of(PlaneCode code) noexcept {
  return unpack_direction(static_cast<std::uint32_t>(code) ^ kNoDirection);
}

}  // namespace

bool valid(PlaneCode code) noexcept {
  return code == PlaneCode::kSpace || code_of(up_of(code)) == code;
}

PlanarMotion::PlanarMotion(const Eigen::Vector3d& up) noexcept : PlanarMotion{code_of(up)} {}

PlanarMotion::PlanarMotion(PlaneCode code) noexcept
    : up_{up_of(code)}, code_{code}, basis_{Basis::Zero()}, out_of_plane_{Matrix6d::Zero()} {
  constexpr double kOnItsSide = 0.9;  // a camera whose x is nearly upright: right is z there
  const Eigen::Vector3d down = -up_;
  const Eigen::Vector3d ahead = Eigen::Vector3d::Unit(std::abs(down.x()) < kOnItsSide ? 0 : 2);
  const Eigen::Vector3d right = (ahead - down.dot(ahead) * down).normalized();
  basis_.col(0).head<3>() = right;
  basis_.col(1).head<3>() = right.cross(down);
  basis_.col(2).tail<3>() = down;
  const Eigen::Matrix3d along = up_ * up_.transpose();
  out_of_plane_.topLeftCorner<3, 3>() = along;
  out_of_plane_.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() - along;
}

Se3 PlanarMotion::project(const Se3& T) const noexcept {
  Se3 out;
  // The twist of the swing-twist decomposition.
  const double along = T.q.vec().dot(up_);
  Eigen::Quaterniond twist{T.q.w(), along * up_.x(), along * up_.y(), along * up_.z()};
  if (twist.norm() > 1e-9) out.q = twist.normalized();
  out.t = T.t - up_.dot(T.t) * up_;
  return out;
}

Eigen::Vector3d PlanarMotion::coordinates(const Se3& T) const noexcept {
  const Vector6d tangent = Se3{T.q, Eigen::Vector3d::Zero()}.log();
  return {basis_.col(0).head<3>().dot(T.t), basis_.col(1).head<3>().dot(T.t),
          basis_.col(2).tail<3>().dot(tangent.tail<3>())};
}

Se3 PlanarMotion::at(const Eigen::Vector3d& coordinates) const noexcept {
  const Eigen::AngleAxisd turn{coordinates.z(), basis_.col(2).tail<3>()};
  return {Eigen::Quaterniond{turn}, basis_.leftCols<2>().topRows<3>() * coordinates.head<2>()};
}

PlanarMotion::Conditioned PlanarMotion::condition(const Se3& T,
                                                  const Matrix6d& covariance) const noexcept {
  Matrix6d sound = covariance;
  sound.diagonal().array() += 1e-12;
  const Se3 start = project(T);
  const Vector6d off = (T.inverse() * start).log();
  const Eigen::LDLT<Matrix6d> solver{sound};
  const Basis weighted = solver.solve(basis_);
  const Eigen::Matrix3d information = basis_.transpose() * weighted;
  const Eigen::Matrix3d in_plane = information.inverse();
  const Eigen::Vector3d step = -in_plane * (weighted.transpose() * off);  // eq. 21
  const Se3 held = project(start * Se3::exp(basis_ * step));
  const Vector6d out = (T.inverse() * held).log();
  sound += out_of_plane_ * (kFlat * kFlat);
  const double excess = out.dot(sound.ldlt().solve(out)) / kChance;
  return {held, widen(std::max(excess, 1.0) * in_plane)};
}

Matrix6d PlanarMotion::restrict_information(const Matrix6d& information) const noexcept {
  const Matrix6d inside = basis_ * basis_.transpose();
  Matrix6d out = inside * information * inside;
  out += out_of_plane_ * (1.0 / (kFlat * kFlat));
  return out;
}

Matrix6d PlanarMotion::widen(const Eigen::Matrix3d& in_plane, double out) const noexcept {
  Matrix6d covariance = basis_ * in_plane * basis_.transpose();
  covariance += out_of_plane_ * (out * out);
  return covariance;
}

}  // namespace maplet
