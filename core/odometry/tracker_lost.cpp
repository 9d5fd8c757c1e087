// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The tracker's part for when the prediction fails: losing the view and finding it.
#include <algorithm>

#include "core/odometry/tracker.hpp"

namespace maplet {

namespace {

constexpr double kFoundOverlap = 0.4;  // a view is recognised, not just tracked on
constexpr double kSearchRad = 0.12;
constexpr double kEstranged = 0.5;    // agreement with an older keyframe, below it is asked alone
constexpr double kStillAgrees = 0.9;  // of what the newest one has
constexpr double kReturnM = 0.1;      // how far a track may have strayed
constexpr double kReturnRad = 0.05;   // the same
constexpr int kFramesBetweenReturns = 5;
constexpr double kFrameS = 1.0 / 30.0;  // no two frames are nearer, whatever their stamps say
constexpr double kAnyStepM = 0.05;      // on top of what the fastest camera makes
constexpr double kAnyStepRad = 0.15;    // the same
constexpr double kCoveredShare = 0.05;  // of the image, with depth

}  // namespace

Loss Tracker::blindness(const PatchSet& patches) const noexcept {
  if (view().facets().size() >= static_cast<std::size_t>(config_.min_pairs)) return Loss::kNone;
  const double pixels = static_cast<double>(patches.camera.width_px) * patches.camera.height_px;
  if (patches.valid_pixels == 0) return Loss::kNoDepth;
  return patches.valid_pixels < kCoveredShare * pixels ? Loss::kCovered : Loss::kFewPatches;
}

Loss Tracker::trouble(const Alignment& alignment, Stamp stamp) const noexcept {
  if (!usable(alignment, config_)) return Loss::kFewInliers;
  if (lost_ && alignment.overlap <= kFoundOverlap) return Loss::kFewInliers;
  return moves_like_a_camera(alignment, stamp) ? Loss::kNone : Loss::kInconsistent;
}

// Whether the fastest camera could have come here since the last tracked frame.
bool Tracker::moves_like_a_camera(const Alignment& alignment, Stamp stamp) const noexcept {
  const Se3 moved = T_odom_last_.inverse() * alignment.T_odom_camera;
  const double dt_s = std::max(seconds(stamp - tracked_stamp_), kFrameS * (1 + lost_in_a_row_));
  return moved.t.norm() < kAnyStepM + config_.max_speed_mps * dt_s &&
         moved.angle() < kAnyStepRad + config_.max_turn_radps * dt_s;
}

// The prediction failed: other starts, the most likely first; the best overlap wins.
Alignment Tracker::search(const KeyframePool::References& references, const PosePrior& prior,
                          Deadline deadline) noexcept {
  Alignment best;
  best.T_odom_camera = filter_.pose();
  for (int i = 0; i < 7; ++i) {
    if (i > 0 && deadline.expired()) break;
    Se3 start = i == 0 ? T_odom_last_ : filter_.pose();
    if (i >= 2) {
      Vector6d turn = Vector6d::Zero();
      turn[3 + (i - 2) / 2 % 3] = i % 2 == 0 ? kSearchRad : -kSearchRad;
      start = start * Se3::exp(turn);
    }
    PosePrior wide = prior;
    wide.information *= 0.1;
    const Alignment tried = try_from(references, wide, {start, kSearchSlackM, kSearchSlackRad},
                                     photo_.none(), deadline);
    if (tried.overlap > best.overlap) best = tried;
    if (usable(best, config_) && best.overlap > kFoundOverlap) break;
  }
  return best;
}

// A lost view is looked for in its own segment, and any view of a segment that hangs on a gap in
// the earlier ones: where it is found there, the camera jumps.
// @param better_than  overlap that what is found must have
bool Tracker::relocalise(Alignment& out, double better_than, Deadline deadline) noexcept {
  const Whereabouts at{filter_.pose(), filter_.covariance(),      segment_,
                       lost_,          !gap_covariance_.isZero(), gap_covariance_};
  Recognition found;
  if (!relocaliser_.run(view(), pool_, aligner_, photo_.none(), at, deadline, found)) return false;
  if (found.alignment.overlap <= better_than) return false;
  out = found.alignment;
  recognised_ = found.stored || found.segment != segment_;
  if (found.stored) ++counters_.in_stored_views;
  if (found.segment == segment_) return true;
  ++counters_.tied;
  jump_to(out.T_odom_camera);
  segment_ = found.segment;
  crossed_ = true;
  return true;
}

// The camera did not move there: what was believed of its place was wrong.
void Tracker::jump_to(const Se3& T_odom_camera) noexcept {
  T_odom_last_ = T_odom_camera * filter_.pose().inverse() * T_odom_last_;
  filter_.jump(T_odom_camera);
}

// An older keyframe whose view the frame should share, but does not from where it is believed to
// be, is tried alone from a little farther. Where it fits as well as the newest one, the track has
// strayed since - behind something that moved - and goes on from there: the older one drifted less.
void Tracker::return_to_older(const KeyframePool::References& references, Alignment& out,
                              Deadline deadline) noexcept {
  if (--frames_to_return_ > 0 || out.older_agreement >= kEstranged) return;
  frames_to_return_ = kFramesBetweenReturns;
  const PosePrior loose{out.T_odom_camera, Matrix6d::Identity()};
  const Alignment older =
      aligner_.run(view(), {&references[1], 1}, loose, {out.T_odom_camera, kReturnM, kReturnRad},
                   photo_.none(), deadline);
  if (!usable(older, config_) || older.overlap <= kFoundOverlap || !older.free_axes.empty() ||
      older.agreement < kStillAgrees * out.agreement) {
    return;
  }
  ++counters_.returned;
  const Vector6d off = (out.T_odom_camera.inverse() * older.T_odom_camera).log();
  strayed_ = off * off.transpose();
  jump_to(older.T_odom_camera);
  out = older;
}

void Tracker::lose(Loss why, Track& track) noexcept {
  ++counters_.lost;
  ++counters_.by_loss[static_cast<std::size_t>(why)];
  ++lost_in_a_row_;
  lost_ = !pool_.empty();
  track.loss = why;
  stand_at_prediction(track);
}

void Tracker::stand_at_prediction(Track& track) noexcept {
  has_previous_ = false;
  track.state = Track::State::kLost;
  track.T_odom_camera = Transform<OdomFrame, CameraFrame>{filter_.pose()};
  if (pool_.empty()) return;
  track.keyframe_id = pool_.newest().id;
  track.T_keyframe_camera = Transform<KeyframeFrame, CameraFrame>{
      pool_.newest().T_odom_camera.se3.inverse() * filter_.pose()};
  track.covariance = filter_.covariance();
}

void Tracker::begin_segment(const DepthFrame& frame, Track& track) noexcept {
  ++counters_.segments;
  segment_ = next_segment_++;
  lost_ = false;
  usable_while_lost_ = 0;
  lost_in_a_row_ = 0;
  stand_at_prediction(track);
  gap_covariance_ += track.covariance;
  track.state = Track::State::kTracking;
  track.keyframe_due = true;
  hints_.keep(frame.motion);
  T_odom_last_ = track.T_odom_camera.se3;
  tracked_stamp_ = frame.stamp;
}

}  // namespace maplet
