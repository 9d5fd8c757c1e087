// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The tracker's part for keyframes: when one is due, and making it.
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "core/odometry/tracker.hpp"

namespace maplet {

namespace {

double log_determinant(const Matrix6d& information) noexcept {
  const Eigen::LLT<Matrix6d> llt{information};
  if (llt.info() != Eigen::Success) return 0.0;
  const Matrix6d l = llt.matrixL();
  return 2.0 * l.diagonal().array().log().sum();
}

}  // namespace

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
  Keyframe& keyframe = pool_.begin_add();
  keyframe.id = next_id_++;
  keyframe.segment = segment_;
  keyframe.blind_spells = blind_spells_;
  keyframe.stamp = frame.stamp;
  keyframe.T_odom_camera = track.T_odom_camera;
  keyframe.covariance = track.covariance;
  keyframe.T_odom_before = track.T_odom_before;
  keyframe.patches = patches;
  first_after_keyframe_ = true;
  filter_.anchor();
  tracked_covariance_.setZero();
  moved_ = 0.0;
  photo_.make_keyframe(frame, patches, view());
  return pool_.commit(view());
}

}  // namespace maplet
