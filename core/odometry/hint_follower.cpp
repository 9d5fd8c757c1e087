// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/hint_follower.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/odometry/camera_reach.hpp"

namespace maplet {

namespace {

constexpr int kWrongToDoubt = 3;
constexpr int kRightToBelieve = 15;
// No odometry is better than this from one frame to the next.
constexpr double kFloorM = 0.003;
constexpr double kFloorRad = 0.003;
// A way over which hints are compared, and how well it is known from what was seen.
constexpr double kWayM = 0.2;
constexpr double kWayRad = 0.3;
constexpr double kWaySigmaM = 0.01;
constexpr double kWaySigmaRad = 0.01;
constexpr double kUnseen = 1e4;    // m^2, rad^2
constexpr double kNewAxis = 0.1;   // squared, outside of those known already
constexpr double kWayGate = 24.0;  // chi-square of 6 degrees of freedom, 5e-4

// A motion that ends so fast did not end: whoever says so has stopped measuring.
constexpr double kBrakeMps2 = 3.0;
constexpr double kBrakeRadps2 = 10.0;
constexpr double kSlowMps = 0.1;
constexpr double kSlowRadps = 0.1;
// While nothing is seen nobody checks what is said; what differs from going on as before is known
// to this share of the difference.
constexpr double kUnseenShare = 0.5;
constexpr double kStandsShare = 0.05;  // of the rate before; a blocked wheel is not quite still
constexpr double kSame = 1e-7;         // m, rad: the same words again

bool says_how_sure(const MotionHint& hint) noexcept { return !hint.path_covariance.isZero(); }

}  // namespace

bool HintFollower::motion(Kind kind, const MotionHint& now, HintedMotion& out) const noexcept {
  const State& state = states_[kind];
  if (!known_ || broke_off(kind) || (state.froze && says_how_sure(now))) return false;
  if (!between(kind, last_, now, out)) return false;
  out.missed = state.missed;
  if (kind == kTurn) return true;
  Matrix6d covariance = out.information.inverse();
  // Noise of single steps; from frame to frame there is one.
  const double more = std::max(0, frames_ - 1);
  covariance.diagonal().head<3>().array() += more * kFloorM * kFloorM;
  covariance.diagonal().tail<3>().array() += more * kFloorRad * kFloorRad;
  if (frames_ > 1 && !says_how_sure(now)) {
    const Vector6d other = (Se3::exp(seconds_ * velocity_).inverse() * out.T_last_now).log();
    const double m = kUnseenShare * other.head<3>().norm();
    const double rad = kUnseenShare * other.tail<3>().norm();
    covariance.diagonal().head<3>().array() += m * m;
    covariance.diagonal().tail<3>().array() += rad * rad;
  }
  out.information = covariance.inverse();
  return out.information.allFinite();
}

void HintFollower::watch(const MotionHint& now, double dt_s) noexcept {
  ++frames_;
  if (dt_s > 0.0) {
    seconds_ += dt_s;
    if (now.has_pose && before_.has_pose) {
      watch(states_[kPose], (before_.T_external_camera.inverse() * now.T_external_camera).log(),
            dt_s);
    }
    if (now.has_turn && before_.has_turn) {
      const Se3 turned{before_.q_gyro_camera.conjugate() * now.q_gyro_camera,
                       Eigen::Vector3d::Zero()};
      watch(states_[kTurn], turned.log(), dt_s);
    }
  }
  before_ = now;
}

void HintFollower::watch(State& state, const Vector6d& step, double dt_s) noexcept {
  const double m = step.head<3>().norm();
  const double rad = step.tail<3>().norm();
  const double rate_m = state.rate.head<3>().norm();
  const double rate_rad = std::max(state.rate.tail<3>().norm(), kSlowRadps);
  if (m < std::max(kSame, kStandsShare * rate_m * dt_s) &&
      rad < std::max(kSame, kStandsShare * rate_rad * dt_s)) {
    state.frozen = state.frozen ||
                   state.rate.head<3>().norm() > std::max(kSlowMps, kBrakeMps2 * dt_s) ||
                   state.rate.tail<3>().norm() > std::max(kSlowRadps, kBrakeRadps2 * dt_s);
    if (!state.frozen) state.rate.setZero();
    state.froze = state.froze || state.frozen;
    state.missed += state.rate * dt_s;
    return;
  }
  state.frozen = false;
  if (!within_reach(m, rad, dt_s, config_)) {
    state.leapt = true;
    return;
  }
  // Between two of its lines the source may be halfway to its last one.
  const Vector6d rate = step / dt_s;
  state.rate = rate.norm() > 0.5 * state.rate.norm() ? rate : Vector6d{0.5 * state.rate};
}

void HintFollower::keep(const MotionHint& now, const Vector6d& velocity) noexcept {
  last_ = now;
  velocity_ = velocity;
  known_ = true;
  frames_ = 0;
  seconds_ = 0.0;
  for (State& state : states_) {
    state.leapt = state.froze = false;
    state.missed.setZero();
  }
}

bool HintFollower::between(Kind kind, const MotionHint& from, const MotionHint& now,
                           HintedMotion& out) const noexcept {
  out.information.setZero();
  if (kind == kTurn) {
    if (!now.has_turn || !from.has_turn) return false;
    out.T_last_now = {from.q_gyro_camera.conjugate() * now.q_gyro_camera, Eigen::Vector3d::Zero()};
    const double sigma = kFloorRad + config_.gyro_share * out.T_last_now.angle();
    out.information.diagonal().tail<3>().setConstant(1.0 / (sigma * sigma));
    return out.T_last_now.q.coeffs().allFinite();
  }
  if (!now.has_pose || !from.has_pose) return false;
  out.T_last_now = from.T_external_camera.inverse() * now.T_external_camera;
  Matrix6d covariance = now.path_covariance - from.path_covariance;
  if (!says_how_sure(now)) {
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

void HintFollower::look_back(const MotionHint& now, const Se3& T_odom_camera,
                             std::span<const Vector6d> free) noexcept {
  const Se3 seen = way_.T_odom_camera.inverse() * T_odom_camera;
  for (const Vector6d& axis : free) {
    const Vector6d rest = axis - way_.free * axis;
    if (rest.squaredNorm() > kNewAxis) way_.free += rest * rest.transpose() / rest.squaredNorm();
  }
  if (way_.begun && seen.t.norm() <= kWayM && seen.angle() <= kWayRad) return;
  for (const auto kind : {kPose, kTurn}) {
    HintedMotion said;
    if (!way_.begun || !between(kind, way_.hint, now, said)) continue;
    const Vector6d off = (said.T_last_now.inverse() * seen).log();
    // In both the motion that was seen is uncertain, too, and unknown along what was not seen; a
    // gyro knows no translation.
    Vector6d variance;
    variance << Eigen::Vector3d::Constant(kWaySigmaM * kWaySigmaM),
        Eigen::Vector3d::Constant(kWaySigmaRad * kWaySigmaRad);
    Matrix6d covariance = kUnseen * way_.free;
    covariance.diagonal() += variance;
    double chi2 = 0.0;
    if (kind == kTurn) {
      Eigen::Matrix3d turn = covariance.bottomRightCorner<3, 3>();
      turn.diagonal().array() += 1.0 / said.information(5, 5);
      chi2 = off.tail<3>().dot(turn.inverse() * off.tail<3>());
    } else {
      covariance += said.information.inverse();
      chi2 = off.dot(covariance.inverse() * off);
    }
    states_[kind].agreed_over_way = chi2 < kWayGate;
  }
  way_ = {now, T_odom_camera, Matrix6d::Zero(), true};
}

Matrix6d HintFollower::rely(const HintedMotion& step, std::span<const Vector6d> free) noexcept {
  const double before = relied_.squaredNorm();
  // What a frozen source missed is wrong as a whole, not by a share.
  const Vector6d way = step.T_last_now.log() + step.missed / config_.external_share;
  const Vector6d whole = step.T_last_now.inverse().adjoint() * relied_ + way;
  relied_.setZero();
  for (const Vector6d& axis : free) relied_ += axis * axis.dot(whole);
  const double grown = relied_.squaredNorm() - before;
  if (!(grown > 0.0)) return Matrix6d::Zero();  // the way back undoes the error of the way there
  const Vector6d along = relied_.normalized();
  const double share = config_.external_share;
  return share * share * grown * (along * along.transpose());
}

bool HintFollower::judge(Kind kind, bool agreed) noexcept {
  State& state = states_[kind];
  agreed = agreed && state.agreed_over_way;
  if (agreed == state.believed) {
    state.streak = 0;
    return agreed;
  }
  const int needed = state.believed ? kWrongToDoubt : kRightToBelieve;
  if (++state.streak >= needed) {
    state.believed = !state.believed;
    state.streak = 0;
  }
  return agreed;
}

}  // namespace maplet
