// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/pose_report.hpp"

namespace maplet::daemon {

namespace {

constexpr double kSameM = 1e-6;
constexpr double kLongestStepS = 0.5;  // a velocity is that of a moment

bool moved(const Se3& T) noexcept { return T.t.norm() > kSameM || T.angle() > kSameM; }

/// Of T_a_b T_b_c, tangent of c.
Matrix6d composed(const Matrix6d& of_a_b, const Se3& T_b_c, const Matrix6d& of_b_c) noexcept {
  const Matrix6d Ad = T_b_c.inverse().adjoint();
  return Ad * of_a_b * Ad.transpose() + of_b_c;
}

}  // namespace

// It does not go on from where it was: another segment, or another place in an earlier one.
bool PoseReporter::broke(const Track& track, const TrackerCounters& counted) noexcept {
  const std::uint64_t gaps = counted.segments + counted.leaps + counted.tied + counted.returned;
  const bool grown = gaps != gaps_;
  gaps_ = gaps;
  return grown || moved(track.T_odom_before);
}

// Both poses hang from the same keyframe, or the earlier one is it.
void PoseReporter::move(const Track& track, OutsidePose& inside, bool& known) noexcept {
  const Se3& T = track.T_odom_camera.se3;
  if (before_) {
    const double dt_s = seconds(track.stamp - before_->stamp);
    const Se3 step = before_->T_odom_camera.inverse() * T;
    known = dt_s > 0.0 && dt_s < kLongestStepS;
    if (known) {
      inside.twist = step.log() / dt_s;
      inside.twist_covariance =
          composed(before_->covariance, step, track.covariance) / (dt_s * dt_s);
    }
  }
}

PoseReport PoseReporter::report(const Step& step, const Agent& agent) noexcept {
  const Track& track = step.track;
  PoseReport out;
  out.stamp = track.stamp;
  out.tracking = track.state == Track::State::kTracking;
  out.partly_free = !track.free_axes.empty();
  const MapFrame::Notice map = agent.map_frame();
  out.map_jumps = map.jumps;
  out.inside.T_map_odom = map.T_map_odom;
  if (out.tracking) {
    if (!begun_) frames_.begin(*step.patches);
    const bool reset = broke(track, agent.tracking()) && begun_;
    begun_ = true;
    if (reset) {
      ++resets_;
      before_.reset();
    }
    out.inside.T_odom_base = track.T_odom_camera.se3;
    out.inside.covariance =
        composed(keyframe_covariance_, track.T_keyframe_camera.se3, track.covariance);
    move(track, out.inside, out.moves);
    const bool keyframe = step.keyframe != nullptr;
    if (keyframe) keyframe_covariance_ = out.inside.covariance;
    before_ = {track.stamp, track.T_odom_camera.se3,
               keyframe ? Matrix6d{Matrix6d::Zero()} : track.covariance};
  } else {
    before_.reset();
  }
  if (step.closed != nullptr) {
    newest_ = step.closed->maplet.key;
    newest_known_ = true;
  }
  frames_.follow(map);
  out.resets = resets_;
  out.enu_flu = frames_.outside(out.inside);
  out.T_map_world = frames_.map_pose(Se3{});
  const Se3* T_world_newest = newest_known_ ? agent.skeleton().pose(newest_) : nullptr;
  if (T_world_newest != nullptr) {
    out.anchored = true;
    out.anchor = newest_;
    out.T_anchor_base = T_world_newest->inverse() * map.T_map_odom * out.inside.T_odom_base *
                        frames_.T_body_camera().inverse();
  }
  return out;
}

}  // namespace maplet::daemon
