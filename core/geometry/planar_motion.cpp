// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/geometry/planar_motion.hpp"

#include <Eigen/Cholesky>

namespace maplet {

PlanarMotion::PlanarMotion(const Eigen::Vector3d& up) noexcept
    : up_{up}, basis_{Basis::Zero()}, out_of_plane_{Matrix6d::Zero()} {
  Eigen::Index flattest = 0;
  up.cwiseAbs().minCoeff(&flattest);
  const Eigen::Vector3d x = up.cross(Eigen::Vector3d::Unit(flattest)).normalized();
  basis_.col(0).head<3>() = x;
  basis_.col(1).head<3>() = up.cross(x);
  basis_.col(2).tail<3>() = up;
  const Eigen::Matrix3d along = up * up.transpose();
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
  return {project(start * Se3::exp(basis_ * step)), widen(in_plane)};
}

Matrix6d PlanarMotion::restrict_information(const Matrix6d& information) const noexcept {
  const Matrix6d inside = basis_ * basis_.transpose();
  Matrix6d out = inside * information * inside;
  out += out_of_plane_ * (1.0 / (kFlat * kFlat));
  return out;
}

Matrix6d PlanarMotion::widen(const Eigen::Matrix3d& in_plane) const noexcept {
  Matrix6d out = basis_ * in_plane * basis_.transpose();
  out += out_of_plane_ * (kFlat * kFlat);
  return out;
}

}  // namespace maplet
