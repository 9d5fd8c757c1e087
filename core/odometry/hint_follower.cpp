// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/hint_follower.hpp"

#include <Eigen/LU>

namespace maplet {

namespace {

constexpr int kWrongToDoubt = 3;
constexpr int kRightToBelieve = 15;
// No odometry is better than this from one frame to the next.
constexpr double kFloorM = 0.003;
constexpr double kFloorRad = 0.003;

}  // namespace

bool HintFollower::motion(Kind kind, const MotionHint& now, HintedMotion& out) const noexcept {
  if (!known_) return false;
  out.information.setZero();
  if (kind == kTurn) {
    if (!now.has_turn || !last_.has_turn) return false;
    out.T_last_now = {last_.q_gyro_camera.conjugate() * now.q_gyro_camera, Eigen::Vector3d::Zero()};
    const double sigma = kFloorRad + config_.gyro_share * out.T_last_now.angle();
    out.information.diagonal().tail<3>().setConstant(1.0 / (sigma * sigma));
    return out.T_last_now.q.coeffs().allFinite();
  }
  if (!now.has_pose || !last_.has_pose) return false;
  out.T_last_now = last_.T_external_camera.inverse() * now.T_external_camera;
  Matrix6d covariance = now.step_covariance;
  if (covariance.isZero()) {
    const double m = config_.external_share * out.T_last_now.t.norm();
    const double rad = config_.external_share * out.T_last_now.angle();
    covariance.diagonal() << Eigen::Vector3d::Constant(m * m), Eigen::Vector3d::Constant(rad * rad);
  }
  covariance.diagonal().head<3>().array() += kFloorM * kFloorM;
  covariance.diagonal().tail<3>().array() += kFloorRad * kFloorRad;
  out.information = covariance.inverse();
  return out.T_last_now.t.allFinite() && out.T_last_now.q.coeffs().allFinite() &&
         out.information.allFinite();
}

void HintFollower::judge(Kind kind, bool agreed) noexcept {
  State& state = states_[kind];
  if (agreed == state.believed) {
    state.streak = 0;
    return;
  }
  const int needed = state.believed ? kWrongToDoubt : kRightToBelieve;
  if (++state.streak < needed) return;
  state.believed = !state.believed;
  state.streak = 0;
}

}  // namespace maplet
