// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/external_odometry.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/odometry/camera_reach.hpp"

namespace maplet::daemon {

namespace {

constexpr double kFarM = 1e6;
constexpr double kMostRate = 100.0;       // m/s, rad/s
constexpr double kMostVariance = 1.0;     // of a step, m^2, rad^2: more is "not known at all"
constexpr double kLeastVariance = 1e-14;  // below it nothing was said
constexpr int kBackwardsToRestart = 20;   // its clock began anew
constexpr int kAgreedToMove = 5;          // its pose was set anew
constexpr Duration kSilent = std::chrono::seconds{1};
constexpr double kSlack = 2.0;  // a wheel spins faster than a camera is carried

bool positive(const Matrix6d& m) noexcept {
  if (!m.isApprox(m.transpose(), 1e-6)) return false;
  const Eigen::LDLT<Matrix6d> ldlt{m};
  return ldlt.info() == Eigen::Success && ldlt.isPositive();
}

/// Says something: not all zero, and not one of the signs for "not known".
bool says(const Matrix6d& m) noexcept { return m.diagonal().maxCoeff() > kLeastVariance; }

/// Variances beyond use become kMostVariance; what is correlated with them keeps its correlation.
Matrix6d bounded(Matrix6d m) noexcept {
  for (int i = 0; i < 6; ++i) {
    if (m(i, i) <= kMostVariance) continue;
    const double scale = std::sqrt(kMostVariance / m(i, i));
    m.row(i) *= scale;
    m.col(i) *= scale;
  }
  return m;
}

}  // namespace

ExternalOdometry::ExternalOdometry(const OdometryConfig& config, const Se3& T_base_camera) noexcept
    : config_{config},
      T_base_camera_{T_base_camera},
      to_camera_{T_base_camera.inverse().adjoint()} {
  config_.max_speed_mps *= kSlack;
  config_.max_turn_radps *= kSlack;
}

void ExternalOdometry::take(const OdometryReport& report, Stamp now) noexcept {
  const Verdict verdict = judge(report, now);
  by_verdict_[static_cast<std::size_t>(verdict)].fetch_add(1, std::memory_order_relaxed);
}

ExternalOdometry::Verdict ExternalOdometry::judge(const OdometryReport& r, Stamp now) noexcept {
  // Written so that NaN fails.
  const bool is_rotation = std::abs(r.q.norm() - 1.0) < 0.01;
  if (!is_rotation || !(r.t.cwiseAbs().maxCoeff() < kFarM) || !r.covariance.allFinite() ||
      !(r.twist.cwiseAbs().maxCoeff() < kMostRate) || !r.t.allFinite() || !r.twist.allFinite() ||
      !r.twist_covariance.allFinite()) {
    return Verdict::kMalformed;
  }
  const Stamp stamp{r.stamp_ns};
  if (stamp < now - kSameClock || stamp > now + kSameClock) return Verdict::kOtherClock;
  if (count_ > 0 && r.writer != writer_) {
    if (stamp - newest_ < kSilent) return Verdict::kOtherPublisher;
    restart();
  }
  if (count_ > 0 && stamp <= newest_) {
    // Its own order tells a clock that began anew from reports that overtook each other.
    backwards_in_a_row_ = stamp > last_backwards_ ? backwards_in_a_row_ + 1 : 1;
    last_backwards_ = stamp;
    if (backwards_in_a_row_ < kBackwardsToRestart) return Verdict::kBackwards;
    restart();
  }
  backwards_in_a_row_ = 0;
  if (count_ > 0 && stamp - newest_ < kLeast) return Verdict::kTooOften;
  const Se3 T{Eigen::Quaterniond{r.q[3], r.q[0], r.q[1], r.q[2]}.normalized(), r.t};
  if (count_ > 0 && !steps_as_a_robot(T_external_base_, T, stamp - newest_)) {
    const bool agrees = agreed_there_ > 0 && stamp > leapt_at_ &&
                        steps_as_a_robot(T_leapt_to_, T, stamp - leapt_at_);
    agreed_there_ = agrees ? agreed_there_ + 1 : 1;
    T_leapt_to_ = T;
    leapt_at_ = stamp;
    if (agreed_there_ < kAgreedToMove) return Verdict::kLeapt;
    restart();
  }
  agreed_there_ = 0;
  keep(r, T);
  return Verdict::kUsed;
}

bool ExternalOdometry::steps_as_a_robot(const Se3& from, const Se3& to,
                                        Duration dt) const noexcept {
  const Se3 step = from.inverse() * to;
  return within_reach(step.t.norm(), step.angle(), seconds(dt), config_);
}

// What its twist says of the time since the report before, else how its pose's covariance grew,
// else a share of the step.
Matrix6d ExternalOdometry::step_covariance(const OdometryReport& r, double dt_s) noexcept {
  const Matrix6d& twist = r.twist_covariance;
  if (says(twist)) {
    if (twist.diagonal().minCoeff() >= 0.0 && positive(twist)) return bounded(dt_s * dt_s * twist);
    ++covariances_left_;
  }
  Matrix6d R = Matrix6d::Zero();
  const Eigen::Matrix3d R_base_external = T_external_base_.rotation().transpose();
  R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = R_base_external;
  const Matrix6d now = R * r.covariance * R.transpose();
  const Matrix6d grown = now - std::exchange(body_covariance_, now);
  if (says(r.covariance) && says(grown)) {
    if (grown.diagonal().minCoeff() >= 0.0 && positive(grown)) return bounded(grown);
    ++covariances_left_;
  }
  return Matrix6d::Zero();
}

void ExternalOdometry::keep(const OdometryReport& r, const Se3& T_external_base) noexcept {
  const bool first = count_ == 0;
  const MotionPose before = first ? MotionPose{} : kept(count_ - 1).pose;
  Kept next;
  next.segment = segment_;
  next.pose.stamp = Stamp{r.stamp_ns};
  next.pose.T_external_camera = T_external_base * T_base_camera_;
  const Se3 step = before.T_external_camera.inverse() * next.pose.T_external_camera;
  const Duration dt = std::min<Duration>(next.pose.stamp - before.stamp, kMostHole);
  T_external_base_ = T_external_base;
  const Matrix6d said = step_covariance(r, first ? 0.0 : seconds(dt));
  if (!first) {
    next.pose.path_covariance = before.path_covariance + to_camera_ * said * to_camera_.transpose();
    // Whoever has said how sure it is, and does not now, is no surer for that.
    if (said.isZero() && !before.path_covariance.isZero()) {
      const double share = config_.external_share;
      const double m = share * step.t.norm();
      const double rad = share * step.angle();
      next.pose.path_covariance.diagonal().head<3>().array() += m * m;
      next.pose.path_covariance.diagonal().tail<3>().array() += rad * rad;
    }
  }
  writer_ = r.writer;
  newest_ = next.pose.stamp;
  ring_[(first_ + count_) % kKept] = next;
  if (count_ < kKept) {
    ++count_;
  } else {
    first_ = (first_ + 1) % kKept;
  }
}

void ExternalOdometry::restart() noexcept {
  first_ = count_ = 0;
  ++segment_;
  agreed_there_ = backwards_in_a_row_ = 0;
  body_covariance_.setZero();
  restarts_.fetch_add(1, std::memory_order_relaxed);
}

MotionHint ExternalOdometry::at(Stamp stamp) noexcept {
  segment_asked_ = segment_;
  std::size_t low = 0;
  std::size_t high = count_;  // the first one that is not before `stamp`
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    if (kept(middle).pose.stamp < stamp) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  if (count_ < 2) return {};
  // Behind the last one: as from the one before it to it.
  const std::size_t after = std::clamp<std::size_t>(low, 1, count_ - 1);
  const MotionPose& a = kept(after - 1).pose;
  const MotionPose& b = kept(after).pose;
  if (stamp < a.stamp || stamp > b.stamp + kMostAhead || b.stamp - a.stamp > kMostHole) return {};
  if (segment_tracked_ != segment_) return {};
  const double share = seconds(stamp - a.stamp) / seconds(b.stamp - a.stamp);
  MotionHint hint = between(a, b, share);
  if (share > 1.0) hint.path_covariance = b.path_covariance;
  return hint;
}

ExternalOdometry::Counters ExternalOdometry::counters() const noexcept {
  Counters out;
  for (std::size_t i = 0; i < kVerdicts; ++i) out.by_verdict[i] = by_verdict_[i];
  out.restarts = restarts_;
  out.covariances_left = covariances_left_;
  return out;
}

}  // namespace maplet::daemon
