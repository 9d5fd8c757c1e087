// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/motion_filter.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr double kStartSpeedMps = 0.5;
constexpr double kStartTurnRadps = 1.0;
constexpr double kDampingS = 0.3;  // unseen motion is forgotten with this time constant
constexpr double kTinyVariance = 1e-10;

Vector6d split(double linear, double angular) noexcept {
  Vector6d v;
  v << Eigen::Vector3d::Constant(linear), Eigen::Vector3d::Constant(angular);
  return v;
}

// A gyro measures the last three only.
bool knows_translation(const Matrix6d& information) noexcept { return information(0, 0) != 0.0; }

}  // namespace

MotionFilter::MotionFilter(const OdometryConfig& config) noexcept
    : acceleration_{split(config.prior_acceleration_mps2,
                          config.prior_angular_acceleration_radps2)},
      fastest_{split(config.max_speed_mps, config.max_turn_radps)} {
  start({});
}

void MotionFilter::start(const Se3& T_odom_camera) noexcept {
  T_odom_camera_ = T_odom_camera;
  velocity_.setZero();
  P_.setZero();
  P_.diagonal().tail<6>() = split(kStartSpeedMps, kStartTurnRadps).cwiseAbs2();
}

void MotionFilter::predict(double dt_s, bool damped) noexcept {
  if (dt_s <= 0.0) return;
  const double damping = damped ? std::exp(-dt_s / kDampingS) : 1.0;
  const Se3 step = Se3::exp(velocity_ * (damped ? kDampingS * (1.0 - damping) : dt_s));
  T_odom_camera_ = T_odom_camera_ * step;
  velocity_ *= damping;
  Eigen::Matrix<double, 12, 12> F = Eigen::Matrix<double, 12, 12>::Identity();
  F.topLeftCorner<6, 6>() = step.inverse().adjoint();
  F.topRightCorner<6, 6>() = dt_s * Matrix6d::Identity();
  P_ = F * P_ * F.transpose();
  const Vector6d dv = acceleration_ * dt_s;
  const Vector6d variance = dv.cwiseAbs2();
  P_.diagonal().tail<6>() += variance;
  P_.diagonal().head<6>() += 0.25 * dt_s * dt_s * variance;
  P_.topRightCorner<6, 6>().diagonal() += 0.5 * dt_s * variance;
  P_.bottomLeftCorner<6, 6>().diagonal() += 0.5 * dt_s * variance;
  // Nobody is faster: scale rows and columns together so that P stays a covariance.
  for (int i = 0; i < 6; ++i) {
    const double sigma = std::sqrt(P_(6 + i, 6 + i));
    if (sigma <= fastest_[i]) continue;
    P_.row(6 + i) *= fastest_[i] / sigma;
    P_.col(6 + i) *= fastest_[i] / sigma;
  }
}

void MotionFilter::blur(double sigma_s) noexcept {
  const Vector6d off = sigma_s * velocity_;
  P_.topLeftCorner<6, 6>() += off * off.transpose();
}

void MotionFilter::loosen() noexcept {
  constexpr double kFrameS = 1.0 / 30.0;
  P_.diagonal().head<6>() += split(kStartSpeedMps * kFrameS, kStartTurnRadps * kFrameS).cwiseAbs2();
}

// A free axis is known only within the noise of the surfaces; coupled to it by that noise, a large
// variance along the axis would turn errors across it into motion along it. Pinching keeps P a
// covariance.
void MotionFilter::decouple(std::span<const Vector6d> free_axes) noexcept {
  if (free_axes.empty()) return;
  Matrix6d free = Matrix6d::Zero();
  for (Vector6d axis : free_axes) {
    axis -= free * axis;
    if (axis.squaredNorm() > 1e-6) free += axis * axis.transpose() / axis.squaredNorm();
  }
  const Matrix6d kept = Matrix6d::Identity() - free;
  for (const int row : {0, 6}) {
    for (const int col : {0, 6}) {
      const Matrix6d block = P_.block<6, 6>(row, col);
      P_.block<6, 6>(row, col) = free * block * free + kept * block * kept;
    }
  }
}

void MotionFilter::update(const Se3& T_odom_camera, const Matrix6d& information,
                          std::span<const Vector6d> free_axes) noexcept {
  decouple(free_axes);
  Matrix6d pose = P_.topLeftCorner<6, 6>();
  pose.diagonal().array() += kTinyVariance;
  const Matrix6d prior = pose.inverse();
  const Matrix6d posterior = (prior + information).inverse();
  const Matrix6d gain = P_.bottomLeftCorner<6, 6>() * prior;
  velocity_ += gain * (T_odom_camera_.inverse() * T_odom_camera).log();
  velocity_ = velocity_.cwiseMax(-fastest_).cwiseMin(fastest_);
  T_odom_camera_ = T_odom_camera;
  Matrix6d velocity = P_.bottomRightCorner<6, 6>();
  velocity -= gain * (pose - posterior) * gain.transpose();
  const Matrix6d cross = gain * posterior;
  P_.topLeftCorner<6, 6>() = 0.5 * (posterior + posterior.transpose());
  P_.bottomRightCorner<6, 6>() = 0.5 * (velocity + velocity.transpose());
  P_.bottomLeftCorner<6, 6>() = cross;
  P_.topRightCorner<6, 6>() = cross.transpose();
}

void MotionFilter::fuse(const Se3& T_odom_camera, const Matrix6d& information) noexcept {
  Matrix6d pose = P_.topLeftCorner<6, 6>();
  pose.diagonal().array() += kTinyVariance;
  const Vector6d delta = (T_odom_camera_.inverse() * T_odom_camera).log();
  const Matrix6d both = pose.inverse() + information;
  Vector6d step = both.ldlt().solve(information * delta);
  if (!step.allFinite()) return;
  if (knows_translation(information)) {
    update(T_odom_camera_ * Se3::exp(step), information, {});
    return;
  }
  // Coupled to the turn by noise, an unseen axis would take velocity from it.
  const Eigen::Vector3d velocity = velocity_.head<3>();
  step.head<3>().setZero();
  update(T_odom_camera_ * Se3::exp(step), information, {});
  velocity_.head<3>() = velocity;
}

MotionFilter::Distance MotionFilter::distance(const Se3& T_odom_camera,
                                              const Matrix6d& information) const noexcept {
  const Vector6d delta = (T_odom_camera_.inverse() * T_odom_camera).log();
  const Matrix6d P = P_.topLeftCorner<6, 6>();
  if (!knows_translation(information)) {
    const Eigen::Matrix3d both = P.bottomRightCorner<3, 3>() +
                                 Eigen::Matrix3d{information.bottomRightCorner<3, 3>()}.inverse();
    const Eigen::Vector3d turn = delta.tail<3>();
    return {turn.dot(both.inverse() * turn), 3};
  }
  return {delta.dot((P + information.inverse()).inverse() * delta), 6};
}

void MotionFilter::anchor() noexcept {
  P_.topLeftCorner<6, 6>().setZero();
  P_.topRightCorner<6, 6>().setZero();
  P_.bottomLeftCorner<6, 6>().setZero();
}

}  // namespace maplet
