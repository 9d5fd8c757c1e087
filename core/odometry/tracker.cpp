// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/tracker.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <span>

#include "core/odometry/free_space.hpp"

namespace maplet {

namespace {

constexpr double kLeastVariance = 1e-10;
constexpr double kGapS = 0.25;      // after which the last velocity says little
constexpr double kMostGapS = 30.0;  // a stamp that jumps farther tells no more
constexpr double kUnusual = 3.0;    // times the usual step: a gap
constexpr double kUsualGain = 0.1;
constexpr double kAgreementGain = 0.3;  // who walks in changes it, too
constexpr int kBackwardToFollow = 3;    // frames in a row: the source's time begins anew
constexpr double kBetterOverlap = 1.1;
constexpr double kMuchMoves = 0.1;
constexpr double kSomeMoves = 0.03;  // less is noise at edges
// What moves is near, and near surfaces are known best: what is left of a body that fills a third
// of the view pulls the pose along (docs/math/odometry.md, "What moves").
constexpr double kPulledM = 0.02;     // a frame, times the share of the view
constexpr double kPulledRad = 0.007;  // the same
constexpr double kStillOverlap = 0.97;
// Standard deviations of a start from which intensities may lead.
constexpr double kGrayNearM = 0.05;
constexpr double kGrayNearRad = 0.05;
// What the alignment can start from.
constexpr double kMostStartM = 0.1;
constexpr double kMostStartRad = 0.1;
constexpr double kGrayContradicts = 3.0;  // times what chance makes of their disagreement
// The keyframes' disagreement, eq. 15.
constexpr double kDisagreementFrames = 200.0;
constexpr double kDisagreementPrior = 6.0;
// Before two keyframes overlap nobody knows; of an ideal sensor 1 would be right, of real ones 10.
constexpr double kFirstDisagreement = 4.0;
constexpr double kLeastDisagreement = 0.7;

// Intensities pull elsewhere than patches: what both see has changed its look, or moves.
bool contradicts(const Alignment& alignment) noexcept {
  return alignment.photo_disagreement > kGrayContradicts * alignment.expected_photo_disagreement;
}

// Without the frame before.
std::span<const Reference> keyframes_of(const KeyframePool::References& references) noexcept {
  std::size_t count = 0;
  while (count < references.size() && !references[count].previous) ++count;
  return {references.data(), count};
}

}  // namespace

Tracker::Tracker(const OdometryConfig& config, Arena& arena)
    : config_{config},
      views_{PatchView{facets_of(config), arena}, PatchView{facets_of(config), arena}},
      aligner_{config, arena},
      pool_{config, arena},
      photo_{config.gray, arena},
      relocaliser_{config, arena},
      filter_{config},
      hints_{config},
      disagreement_{kDisagreementFrames, kDisagreementPrior, kFirstDisagreement} {}

Track Tracker::run(const DepthFrame& frame, const PatchSet& patches, Deadline deadline) noexcept {
  Track track;
  track.stamp = frame.stamp;
  ++counters_.frames;
  const std::uint64_t leaps = counters_.leaps;
  hints_.watch(frame.motion, counters_.frames == 1 ? 0.0 : seconds(frame.stamp - last_stamp_));
  predict(frame.stamp);
  track.leapt = counters_.leaps > leaps;
  now_ = 1 - now_;
  views_[now_].assign(patches, config_);
  if (has_previous_ && moving_ > kSomeMoves) carry_marks(views_[now_], views_[1 - now_]);
  photo_.assign(frame);
  if (const Loss blind = blindness(patches); blind != Loss::kNone) {
    lose(blind, track);
    return track;
  }
  if (pool_.empty()) {
    filter_.start({});
    tracked_stamp_ = frame.stamp;
    track.state = Track::State::kTracking;
    track.keyframe_due = true;
    track.overlap = 1.0;
    track.inliers = static_cast<std::uint32_t>(view().facets().size());
    hints_.keep(frame.motion, filter_.velocity());
    return track;
  }
  Guess guess;
  take_hints(frame.motion, guess);
  PosePrior prior{filter_.pose(), Matrix6d::Zero()};
  Matrix6d covariance = filter_.covariance();
  covariance.diagonal().array() += kLeastVariance;
  prior.information = covariance.inverse();
  if (may_be_anywhere(frame.stamp)) {
    Alignment found;
    if (find_out(found, deadline)) {
      ++counters_.recovered;
      accept(frame, found, track);
    } else if (++usable_while_lost_ >= patience()) {
      begin_segment(frame, track);
    } else {
      lose(Loss::kUnsure, track);
    }
    return track;
  }
  const KeyframePool::References seen = references();
  Alignment alignment = align(seen, prior, guess, deadline);
  const Loss loss = trouble(alignment, frame.stamp);
  if (loss == Loss::kNone) {
    if (lost_) ++counters_.recovered;
    if (lost_ && !unexplained_) {
      // Where it went on may look alike: keyframes that fit better have the word.
      const double fits = alignment.free_axes.empty() ? kBetterOverlap * alignment.overlap : 0.0;
      (void)relocalise(alignment, fits, deadline);
    } else if (!gap_covariance_.isZero()) {
      contenders_.step(T_odom_last_.inverse() * alignment.T_odom_camera);
      (void)find_out(alignment, deadline);
    } else {
      return_to_older(seen, alignment, deadline);
    }
    const Stamp before = tracked_stamp_;
    accept(frame, alignment, track);
    moving_ = mark_what_moves(views_[now_], keyframes_of(seen), alignment.T_odom_camera, moving_);
    if (seconds(frame.stamp - before) > kVideoS) trust_all(views_[now_]);
    if (moving_ > kMuchMoves) ++counters_.with_moving;
    doubt(moving_, track);
  } else if (lost_ && (unexplained_ ? find_out(alignment, deadline)
                                    : relocalise(alignment, 0.0, deadline))) {
    ++counters_.recovered;
    accept(frame, alignment, track);
  } else if (lost_ && ++usable_while_lost_ >= patience()) {
    begin_segment(frame, track);
  } else {
    lose(loss, track);
  }
  return track;
}

void Tracker::predict(Stamp stamp) noexcept {
  double dt_s = counters_.frames == 1 ? 0.0 : seconds(stamp - last_stamp_);
  if (counters_.frames > 1 && dt_s <= 0.0) {
    ++counters_.not_forward;
    filter_.loosen();
    if (++backward_ < kBackwardToFollow) return;
    dt_s = 0.0;
  }
  backward_ = 0;
  last_stamp_ = stamp;
  if (usual_step_s_ == 0.0) usual_step_s_ = dt_s;
  if (dt_s > anywhere_s(config_) && dt_s > kUnusual * usual_step_s_ && !pool_.empty()) lost_ = true;
  usual_step_s_ += kUsualGain * (std::min(dt_s, kMostGapS) - usual_step_s_);
  if (dt_s > kMostGapS && !pool_.empty()) {
    // Where the camera is may only be recognised, as after a loss.
    ++counters_.leaps;
    lost_ = true;
    lost_in_a_row_ = std::max(lost_in_a_row_, config_.lost_frames);
  }
  filter_.predict(std::min(dt_s, kMostGapS), lost_ || dt_s > kGapS);
  if (counters_.frames <= 1 || dt_s > kGapS) return;
  jitter_.add(dt_s);
  filter_.blur(jitter_.sigma_s());
}

KeyframePool::References Tracker::references() noexcept {
  auto out = pool_.references(view(), filter_.pose());
  if (has_previous_ && !lost_ && out.size() < PatchAligner::kMaxReferences) {
    out.push_back({&views_[1 - now_], T_odom_last_.inverse(), true});
  }
  return out;
}

PhotoTerm& Tracker::gray() noexcept {
  return photo_.against(pool_.newest().T_odom_camera.se3.inverse());
}

Alignment Tracker::try_from(const KeyframePool::References& references, const PosePrior& prior,
                            const Start& start, PhotoTerm& photo, Deadline deadline) noexcept {
  return aligner_.run(view(), {references.data(), references.size()}, prior, start, photo,
                      deadline);
}

Alignment Tracker::align(const KeyframePool::References& references, const PosePrior& prior,
                         const Guess& guess, Deadline deadline) noexcept {
  const Matrix6d covariance = filter_.covariance();
  const Start start{filter_.pose(),
                    std::min(largest_sigma(covariance.topLeftCorner<3, 3>()), kMostStartM),
                    std::min(largest_sigma(covariance.bottomRightCorner<3, 3>()), kMostStartRad)};
  // Intensities lead to the nearest likeness: from farther away patches go alone, and first.
  const bool near = start.sigma_m < kGrayNearM && start.sigma_rad < kGrayNearRad;
  Alignment alignment = try_from(references, prior, start, near ? gray() : photo_.none(), deadline);
  if (contradicts(alignment)) {
    photo_.learn(alignment);
    alignment = try_from(references, prior, start, photo_.none(), deadline);
  }
  const bool whole = near && usable(alignment, config_);
  if (guess.any) {
    PosePrior wide{guess.T_odom_camera, 0.1 * prior.information};
    const Alignment other =
        try_from(references, wide, {guess.T_odom_camera, kSearchSlackM, kSearchSlackRad},
                 photo_.none(), deadline);
    if (usable(other, config_) && other.overlap > kBetterOverlap * alignment.overlap) {
      return refine(references, other, prior, deadline);
    }
  }
  if (whole) return alignment;
  if (!usable(alignment, config_)) {
    ++counters_.retried;
    alignment = search(references, prior, deadline);
  }
  return refine(references, alignment, prior, deadline);
}

// Intensities join where patches have come to, and are left out where they lead away from it.
Alignment Tracker::refine(const KeyframePool::References& references, const Alignment& patches,
                          PosePrior prior, Deadline deadline) noexcept {
  PhotoTerm& photo = gray();
  if (photo.empty() || !usable(patches, config_)) return patches;
  prior.information *= 0.1;
  const Alignment refined =
      try_from(references, prior, {patches.T_odom_camera, 0.0, 0.0}, photo, deadline);
  const bool better = refined.gray && usable(refined, config_) && !contradicts(refined) &&
                      refined.overlap > kStillOverlap * patches.overlap;
  return better ? refined : patches;
}

void Tracker::doubt(double moving_share, Track& track) noexcept {
  moved_ += moving_share * moving_share;
  track.covariance.diagonal().head<3>().array() += kPulledM * kPulledM * moved_;
  track.covariance.diagonal().tail<3>().array() += kPulledRad * kPulledRad * moved_;
}

void Tracker::accept(const DepthFrame& frame, const Alignment& alignment, Track& track) noexcept {
  disagreement_.add(alignment.disagreement, alignment.expected_disagreement);
  track.disagreement = std::max(kLeastDisagreement, disagreement_.value());
  judge_hints(frame.motion, alignment);
  photo_.learn(alignment);
  filter_.update(alignment.T_odom_camera, alignment.information / track.disagreement,
                 {alignment.free_axes.data(), alignment.free_axes.size()});
  hints_.keep(frame.motion, filter_.velocity());
  if (relied_on_ && frame.motion.path_covariance.isZero()) {
    filter_.widen(
        hints_.rely(*relied_on_, {alignment.free_axes.data(), alignment.free_axes.size()}));
  }
  tracked_stamp_ = frame.stamp;
  lost_ = false;
  usable_while_lost_ = 0;
  unexplained_ = false;
  usual_agreement_ =
      usual_agreement_ == 0.0
          ? alignment.most_agreement
          : usual_agreement_ + kAgreementGain * (alignment.most_agreement - usual_agreement_);
  has_previous_ = true;
  T_odom_last_ = alignment.T_odom_camera;
  track.state = Track::State::kTracking;
  track.keyframe_id = pool_.newest().id;
  track.T_odom_camera = Transform<OdomFrame, CameraFrame>{alignment.T_odom_camera};
  track.T_keyframe_camera = Transform<KeyframeFrame, CameraFrame>{
      pool_.newest().T_odom_camera.se3.inverse() * alignment.T_odom_camera};
  track.covariance = tracked_covariance_ = filter_.covariance();
  track.free_axes = alignment.free_axes;
  track.inliers = alignment.inliers;
  track.overlap = alignment.overlap;
  track.iterations = alignment.iterations;
  track.stop = alignment.stop;
  track.gray = alignment.gray;
  if (track.gray) ++counters_.with_gray;
  track.keyframe_due = keyframe_due(track, alignment);
  if (lost_in_a_row_ >= config_.lost_frames) {
    ++blind_spells_;
    track.keyframe_due = true;
  }
  lost_in_a_row_ = 0;
  if (!strayed_.isZero()) {
    track.covariance += strayed_;
    strayed_.setZero();
    ++blind_spells_;
    track.keyframe_due = true;
  }
  if (!recognised_) return;
  // No keyframe may see this: it becomes one.
  recognised_ = false;
  track.keyframe_due = true;
  if (!crossed_) return;
  crossed_ = false;
  track.T_odom_before = T_odom_before_;
  if (segment_ == 0) gap_covariance_.setZero();
}

}  // namespace maplet
