// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The tracker's part for when the prediction fails: losing the view and finding it.
#include <algorithm>
#include <cmath>

#include "core/odometry/camera_reach.hpp"
#include "core/odometry/tracker.hpp"

namespace maplet {

namespace {

constexpr double kSearchRad = 0.12;
constexpr double kEstranged = 0.5;    // agreement with an older keyframe, below it is asked alone
constexpr double kStillAgrees = 0.9;  // of what the newest one has
constexpr double kReturnM = 0.1;      // how far a track may have strayed
constexpr double kReturnRad = 0.05;   // the same
constexpr int kFramesBetweenReturns = 5;
constexpr double kFrameS = 1.0 / 30.0;  // no two frames are nearer, whatever their stamps say
constexpr double kCoveredShare = 0.05;  // of the image, with depth
constexpr double kMostChange = 0.1;     // of the agreement; tracked frames differ by a hundredth
constexpr int kPatience = 4;
constexpr double kNearM = 0.5;  // to where the camera is believed to be
constexpr double kNearRad = 0.5;
// A camera that is turned briskly, at this share of what is possible at all, has this angle behind
// it when another wall of a room can take the place of the one that it looked at.
constexpr double kBriskShare = 0.25;
constexpr double kAnotherWallRad = 1.2;
constexpr double kAnywhereSigmaRad = 0.35;  // a third of it
// Nothing is known of the way.
constexpr double kAnyTurnRad = 1.8;  // uniform over half a turn to each side
constexpr double kAnyWayM = 3.0;

}  // namespace

double Tracker::anywhere_s(const OdometryConfig& config) noexcept {
  return kAnotherWallRad / (kBriskShare * config.max_turn_radps);
}

Loss Tracker::blindness(const PatchSet& patches) const noexcept {
  if (view().facets().size() >= static_cast<std::size_t>(config_.min_pairs)) return Loss::kNone;
  const double pixels = static_cast<double>(patches.camera.width_px) * patches.camera.height_px;
  if (patches.valid_pixels == 0) return Loss::kNoDepth;
  return patches.valid_pixels < kCoveredShare * pixels ? Loss::kCovered : Loss::kFewPatches;
}

Loss Tracker::trouble(const Alignment& alignment, Stamp stamp) const noexcept {
  if (!usable(alignment, config_)) return Loss::kFewInliers;
  if (lost_ && alignment.overlap <= kFoundOverlap) return Loss::kFewInliers;
  if (changed_at_once(alignment, stamp)) return Loss::kFewInliers;
  return moves_like_a_camera(alignment, stamp) ? Loss::kNone : Loss::kInconsistent;
}

// From one frame to the next of a video what both see hardly changes: where it does, the view is
// another one that happens to fit. The same holds for what comes after a loss in full light.
bool Tracker::changed_at_once(const Alignment& alignment, Stamp stamp) const noexcept {
  const bool video = seconds(stamp - tracked_stamp_) < kVideoS;
  return (lost_ ? unexplained_ : video) &&
         alignment.most_agreement < usual_agreement_ - kMostChange;
}

// Whether the fastest camera could have come here since the last tracked frame.
bool Tracker::moves_like_a_camera(const Alignment& alignment, Stamp stamp) const noexcept {
  const Se3 moved = T_odom_last_.inverse() * alignment.T_odom_camera;
  const double dt_s = std::max(seconds(stamp - tracked_stamp_), kFrameS * (1 + lost_in_a_row_));
  return within_reach(moved.t.norm(), moved.angle(), dt_s, config_);
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

// Lost for so long, and with so little knowledge, that it may look at another wall by now.
bool Tracker::may_be_anywhere(Stamp stamp) const noexcept {
  const double dt_s = std::max(seconds(stamp - tracked_stamp_), kFrameS * lost_in_a_row_);
  return lost_ && dt_s > anywhere_s(config_) &&
         largest_sigma(filter_.covariance().bottomRightCorner<3, 3>()) > kAnywhereSigmaRad;
}

// A view that was lost a moment ago is looked for in its own segment.
// @param better_than  overlap that what is found must have
bool Tracker::relocalise(Alignment& out, double better_than, Deadline deadline) noexcept {
  const Whereabouts at{filter_.pose(), filter_.covariance(), segment_, true, false, {}};
  const auto found = relocaliser_.run(view(), pool_, aligner_, photo_.none(), at, 1, deadline);
  if (found.empty() || found[0].alignment.overlap <= better_than) return false;
  out = found[0].alignment;
  take_place(found[0]);
  return true;
}

// Views everywhere that the camera may be are asked, several frames long: in this segment while it
// is lost, in the earlier ones as long as this one hangs on a gap.
bool Tracker::find_out(Alignment& out, Deadline deadline) noexcept {
  if (contenders_.empty()) relocaliser_.begin_round();
  if (lost_) contenders_.step({});
  const Whereabouts at{filter_.pose(), filter_.covariance(),      segment_,
                       lost_,          !gap_covariance_.isZero(), gap_covariance_};
  const auto found =
      relocaliser_.run(view(), pool_, aligner_, photo_.none(), at, Relocaliser::kTries, deadline);
  const auto place_of = [&](const Recognition& r) {
    const Se3 off = filter_.pose().inverse() * r.alignment.T_odom_camera;
    return Contenders::Place{r.alignment.T_odom_camera, r.segment,
                             off.t.norm() < kNearM && off.angle() < kNearRad};
  };
  for (const Recognition& r : found) {
    if (r.telling) contenders_.vote(place_of(r));
  }
  for (const Recognition& r : found) {
    const Contenders::Place place = place_of(r);
    if (!r.telling || !relocaliser_.round_complete(pool_, place.near)) continue;
    if (!contenders_.won(place)) continue;
    out = r.alignment;
    take_place(r);
    return true;
  }
  return false;
}

void Tracker::take_place(const Recognition& found) noexcept {
  contenders_.clear();
  recognised_ = found.stored || found.segment != segment_;
  if (found.stored) ++counters_.in_stored_views;
  if (found.segment == segment_) return;
  ++counters_.tied;
  jump_to(found.alignment.T_odom_camera);
  segment_ = found.segment;
  crossed_ = true;
}

// Usable frames that may pass before a new segment begins; more while there is something to decide.
int Tracker::patience() const noexcept {
  return contenders_.empty() ? config_.lost_frames : kPatience * config_.lost_frames;
}

// The camera did not move there: what was believed of its place was wrong.
void Tracker::jump_to(const Se3& T_odom_camera) noexcept {
  T_odom_before_ = T_odom_camera * filter_.pose().inverse();
  T_odom_last_ = T_odom_before_ * T_odom_last_;
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
  if (!recognised(older, config_) || older.agreement < kStillAgrees * out.agreement) return;
  ++counters_.returned;
  const Vector6d off = (out.T_odom_camera.inverse() * older.T_odom_camera).log();
  strayed_ = off * off.transpose();
  jump_to(older.T_odom_camera);
  out = older;
}

void Tracker::lose(Loss why, Track& track) noexcept {
  ++counters_.lost;
  ++counters_.by_loss[static_cast<std::size_t>(why)];
  if (lost_in_a_row_++ == 0) unexplained_ = why == Loss::kFewInliers || why == Loss::kInconsistent;
  lost_ = !pool_.empty();
  track.loss = why;
  stand_at_prediction(track);
}

void Tracker::stand_at_prediction(Track& track) noexcept {
  has_previous_ = false;
  moving_ = 0.0;
  track.state = Track::State::kLost;
  track.T_odom_camera = Transform<OdomFrame, CameraFrame>{filter_.pose()};
  if (pool_.empty()) return;
  track.keyframe_id = pool_.newest().id;
  track.T_keyframe_camera = Transform<KeyframeFrame, CameraFrame>{
      pool_.newest().T_odom_camera.se3.inverse() * filter_.pose()};
  track.covariance = filter_.covariance();
}

// What is known of the way from the last keyframe to here. Where the view was lost in full light
// the motion was none of those that the filter expects.
Matrix6d Tracker::gap() const noexcept {
  Matrix6d covariance = filter_.covariance();
  for (int i = 0; i < 6; ++i) {
    const double sigma = std::sqrt(covariance(i, i));
    if (!(sigma > 0.0)) continue;
    const double most = i < 3 ? sigma : kAnyTurnRad;
    double wanted = std::min(sigma, most);
    if (unexplained_) wanted = i < 3 ? std::max(sigma, kAnyWayM) : kAnyTurnRad;
    covariance.row(i) *= wanted / sigma;
    covariance.col(i) *= wanted / sigma;
  }
  return covariance;
}

void Tracker::begin_segment(const DepthFrame& frame, Track& track) noexcept {
  ++counters_.segments;
  segment_ = next_segment_++;
  lost_ = false;
  usable_while_lost_ = 0;
  lost_in_a_row_ = 0;
  stand_at_prediction(track);
  track.covariance = gap();
  unexplained_ = false;
  gap_covariance_ += track.covariance;
  track.state = Track::State::kTracking;
  track.keyframe_due = true;
  hints_.keep(frame.motion, filter_.velocity());
  T_odom_last_ = track.T_odom_camera.se3;
  tracked_stamp_ = frame.stamp;
}

}  // namespace maplet
