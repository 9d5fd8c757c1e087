// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The tracker's part for what others say of the camera's motion.
#include "core/odometry/tracker.hpp"

namespace maplet {

namespace {

constexpr double kHintGate[] = {32.0, 24.0};  // chi-square of 6 and 3 degrees of freedom, 5e-5

}  // namespace

// What others measured joins the prediction where the two agree; what contradicts it is kept as
// another place to begin.
void Tracker::take_hints(const MotionHint& hint, Guess& guess) noexcept {
  relied_on_.reset();
  bool used = false;
  Matrix6d turn = Matrix6d::Identity();
  for (const auto kind : {HintFollower::kPose, HintFollower::kTurn}) {
    HintedMotion motion;
    if (hints_.broke_off(kind)) ++counters_.hints_refused;
    if (!hints_.believed(kind) || !hints_.motion(kind, hint, motion)) continue;
    Se3 hinted = T_odom_last_ * motion.T_last_now;
    if (kind == HintFollower::kTurn) hinted.t = filter_.pose().t;
    if (filter_.distance(hinted, motion.information).chi2 < kHintGate[kind]) {
      filter_.fuse(hinted, motion.information);
      ++counters_.hints_used;
      used = true;
      turn = motion.T_last_now.inverse().adjoint();
      if (kind == HintFollower::kPose) relied_on_ = motion;
    } else if (!guess.any) {
      guess = {true, hinted};
    }
  }
  // It is a motion since the last tracked frame: what was not known there is not known here.
  if (used) filter_.widen(turn * tracked_covariance_ * turn.transpose());
}

// A hint is right when the motion that was seen is within its own and the filter's uncertainty.
void Tracker::judge_hints(const MotionHint& hint, const Alignment& alignment) noexcept {
  hints_.look_back(hint, alignment.T_odom_camera,
                   {alignment.free_axes.data(), alignment.free_axes.size()});
  for (const auto kind : {HintFollower::kPose, HintFollower::kTurn}) {
    HintedMotion motion;
    if (!hints_.motion(kind, hint, motion)) continue;
    Vector6d off = ((T_odom_last_ * motion.T_last_now).inverse() * alignment.T_odom_camera).log();
    for (const Vector6d& axis : alignment.free_axes) off -= axis * axis.dot(off);
    const bool agreed = off.dot(motion.information * off) < kHintGate[kind];
    if (!hints_.judge(kind, agreed)) ++counters_.hints_refused;
  }
}

}  // namespace maplet
