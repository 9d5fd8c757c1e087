// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/tracker.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr double kMaxChi2PerDof = 2.5;
constexpr double kFoundOverlap = 0.4;  // a view is recognised, not just tracked on
constexpr double kSearchSlackM = 0.1;
constexpr double kSearchSlackRad = 0.1;
constexpr double kSearchRad = 0.12;

double log_determinant(const Matrix6d& information) noexcept {
  const Eigen::LLT<Matrix6d> llt{information};
  if (llt.info() != Eigen::Success) return 0.0;
  const Matrix6d l = llt.matrixL();
  return 2.0 * l.diagonal().array().log().sum();
}

// The largest standard deviation, within what the alignment can start from.
double largest_sigma(const Eigen::Matrix3d& covariance) noexcept {
  return std::min(std::sqrt(covariance.diagonal().maxCoeff()), 0.1);
}

}  // namespace

Tracker::Tracker(const OdometryConfig& config, Arena& arena)
    : config_{config},
      view_{arena},
      aligner_{config, arena},
      pool_{config, arena},
      filter_{config} {}

Track Tracker::run(const DepthFrame& frame, const PatchSet& patches, Deadline deadline) noexcept {
  Track track;
  track.stamp = frame.stamp;
  ++counters_.frames;
  const double dt_s = counters_.frames == 1 ? 0.0 : seconds(frame.stamp - last_stamp_);
  if (counters_.frames > 1 && dt_s <= 0.0) ++counters_.not_forward;
  if (dt_s > 0.0 || counters_.frames == 1) last_stamp_ = frame.stamp;
  filter_.predict(dt_s, lost_);
  view_.assign(patches, config_);
  if (view_.facets().size() < static_cast<std::size_t>(config_.min_pairs)) {
    lose(track);
    return track;
  }
  if (pool_.empty()) {
    filter_.start({});
    track.state = Track::State::kTracking;
    track.keyframe_due = true;
    track.overlap = 1.0;
    track.inliers = static_cast<std::uint32_t>(view_.facets().size());
    return track;
  }
  PosePrior prior{filter_.pose(), Matrix6d::Zero()};
  Matrix6d covariance = filter_.covariance();
  covariance.diagonal().array() += 1e-10;
  prior.information = covariance.inverse();
  const auto references = pool_.references(view_, filter_.pose());
  const Start start{filter_.pose(), largest_sigma(covariance.topLeftCorner<3, 3>()),
                    largest_sigma(covariance.bottomRightCorner<3, 3>())};
  Alignment alignment =
      aligner_.run(view_, {references.data(), references.size()}, prior, start, deadline);
  if (!usable(alignment)) {
    ++counters_.retried;
    alignment = search(references, prior, deadline);
  }
  if (usable(alignment) && (!lost_ || alignment.overlap > kFoundOverlap)) {
    if (lost_) ++counters_.recovered;
    accept(alignment, track);
  } else if (lost_ && relocalise(prior, alignment, deadline)) {
    ++counters_.recovered;
    accept(alignment, track);
  } else if (lost_ && ++usable_while_lost_ >= config_.lost_frames) {
    begin_segment(track);
  } else {
    lose(track);
  }
  return track;
}

bool Tracker::usable(const Alignment& alignment) const noexcept {
  return alignment.inliers >= static_cast<std::uint32_t>(config_.min_pairs) &&
         alignment.overlap >= config_.min_overlap && alignment.chi2_per_dof < kMaxChi2PerDof;
}

// The prediction failed: other starts, the most likely first; the best overlap wins.
Alignment Tracker::search(const KeyframePool::References& references, const PosePrior& prior,
                          Deadline deadline) noexcept {
  const Se3 still = filter_.pose() * Se3::exp(-filter_.velocity() * (1.0 / 30.0));
  Alignment best;
  best.T_odom_camera = filter_.pose();
  for (int i = 0; i < 6; ++i) {
    if (i > 0 && deadline.expired()) break;
    Se3 start = i == 0 ? still : filter_.pose();
    if (i >= 2) {
      Vector6d turn = Vector6d::Zero();
      turn[3 + (i - 2) / 2] = i % 2 == 0 ? kSearchRad : -kSearchRad;
      start = filter_.pose() * Se3::exp(turn);
    }
    PosePrior wide = prior;
    wide.information *= 0.1;
    const Alignment tried = aligner_.run(view_, {references.data(), references.size()}, wide,
                                         {start, kSearchSlackM, kSearchSlackRad}, deadline);
    if (tried.overlap > best.overlap) best = tried;
    if (usable(best) && best.overlap > kFoundOverlap) break;
  }
  return best;
}

// Looks for the view in one keyframe of the pool a frame, from that keyframe's own pose.
bool Tracker::relocalise(const PosePrior& prior, Alignment& out, Deadline deadline) noexcept {
  next_slot_ = (next_slot_ + 1) % pool_.size();
  if (pool_.keyframe(next_slot_).segment != segment_) return false;
  PosePrior wide = prior;
  wide.information *= 0.01;
  const Reference reference = pool_.reference(next_slot_);
  out = aligner_.run(view_, {&reference, 1}, wide,
                     {pool_.keyframe(next_slot_).T_odom_camera.se3, kSearchSlackM, kSearchSlackRad},
                     deadline);
  return usable(out) && out.overlap > kFoundOverlap && out.free_axes.empty();
}

void Tracker::accept(const Alignment& alignment, Track& track) noexcept {
  filter_.update(alignment.T_odom_camera, alignment.information,
                 {alignment.free_axes.data(), alignment.free_axes.size()});
  lost_ = false;
  usable_while_lost_ = 0;
  track.state = Track::State::kTracking;
  track.keyframe_id = pool_.newest().id;
  track.T_odom_camera = Transform<OdomFrame, CameraFrame>{alignment.T_odom_camera};
  track.T_keyframe_camera = Transform<KeyframeFrame, CameraFrame>{
      pool_.newest().T_odom_camera.se3.inverse() * alignment.T_odom_camera};
  track.covariance = filter_.covariance();
  track.free_axes = alignment.free_axes;
  track.inliers = alignment.inliers;
  track.overlap = alignment.overlap;
  track.iterations = alignment.iterations;
  track.stop = alignment.stop;
  track.keyframe_due = keyframe_due(track, alignment);
}

void Tracker::lose(Track& track) noexcept {
  ++counters_.lost;
  lost_ = !pool_.empty();
  track.state = Track::State::kLost;
  track.T_odom_camera = Transform<OdomFrame, CameraFrame>{filter_.pose()};
  if (pool_.empty()) return;
  track.keyframe_id = pool_.newest().id;
  track.T_keyframe_camera = Transform<KeyframeFrame, CameraFrame>{
      pool_.newest().T_odom_camera.se3.inverse() * filter_.pose()};
  track.covariance = filter_.covariance();
}

void Tracker::begin_segment(Track& track) noexcept {
  ++counters_.segments;
  ++segment_;
  lost_ = false;
  usable_while_lost_ = 0;
  lose(track);
  --counters_.lost;
  lost_ = false;
  track.state = Track::State::kTracking;
  track.keyframe_due = true;
}

bool Tracker::keyframe_due(const Track& track, const Alignment& alignment) noexcept {
  const Matrix6d information = track.covariance.inverse();
  const double log_information = log_determinant(information);
  if (first_after_keyframe_) {
    first_log_information_ = log_information;
    first_after_keyframe_ = false;
  }
  // Entropy per degree of freedom grew: 0.5 (ln |H_first| - ln |H|) / 6 (eq. 12).
  const double entropy = (first_log_information_ - log_information) / 12.0;
  return alignment.first_overlap < config_.keyframe_overlap ||
         track.T_keyframe_camera.se3.t.norm() > config_.keyframe_distance_m ||
         track.T_keyframe_camera.se3.angle() > config_.keyframe_rad ||
         entropy > config_.keyframe_entropy;
}

const Keyframe& Tracker::make_keyframe(const DepthFrame& frame, const PatchSet& patches,
                                       const Track& track) noexcept {
  Keyframe& keyframe = pool_.begin_add(track.T_odom_camera.se3);
  keyframe.id = next_id_++;
  keyframe.segment = segment_;
  keyframe.stamp = frame.stamp;
  keyframe.T_odom_camera = track.T_odom_camera;
  keyframe.covariance = track.covariance;
  keyframe.patches = patches;
  first_after_keyframe_ = true;
  filter_.anchor();
  return pool_.commit();
}

}  // namespace maplet
