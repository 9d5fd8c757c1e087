// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/photo_term.hpp"

#include <algorithm>
#include <cmath>

#include "core/odometry/photo_sums.hpp"

namespace maplet {

namespace {

constexpr float kStartSigma = 12.0F;
constexpr float kLeastSigma = 2.0F;
constexpr float kMaxGain = 6.0F;
constexpr int kMinPoints = 40;  // fewer say nothing of gain, offset and scale

PhotoLook look_at(const GrayPyramid::Level& image, const Se3& T_reference_camera,
                  const Se3& T_gray_depth) noexcept {
  return {T_reference_camera.inverse(), T_gray_depth, image};
}

}  // namespace

void PhotoTerm::begin(const GrayPyramid& frame, const PhotoView& keyframe,
                      const Se3& T_reference_odom, const Se3& T_gray_depth,
                      double inflation) noexcept {
  frame_ = &frame;
  keyframe_ = frame.empty() || keyframe.empty() ? nullptr : &keyframe;
  T_reference_odom_ = T_reference_odom;
  T_gray_depth_ = T_gray_depth;
  inflation_ = inflation;
  gain_ = 1.0F;
  offset_ = 0.0F;
  sigma_ = kStartSigma;
  seen_ = 0;
  kept_ = 0.0;
}

// take() as in PhotoLook::visit().
template <class Visit>
void PhotoTerm::visit(const Se3& T_odom_camera, int level, Visit&& take) const noexcept {
  const PhotoLook look =
      look_at(frame_->level(level), T_reference_odom_ * T_odom_camera, T_gray_depth_);
  look.visit(keyframe_->points(level), take);
}

// Eq. 17: gain and offset between the two images, and the residuals' scale, by weighted least
// squares with the present weights.
void PhotoTerm::follow_brightness(const Se3& T_odom_camera, int level) noexcept {
  const PhotoLook look =
      look_at(frame_->level(level), T_reference_odom_ * T_odom_camera, T_gray_depth_);
  const std::span<const PhotoPoint> points = keyframe_->points(level);
  const auto [n, x, y, xx, xy] =
      kPhotoBest.intensities(look, points, {gain_, offset_, 2.0F * sigma_});
  if (n < kMinPoints) return;
  const float variance = xx / n - (x / n) * (x / n);
  const float covariance = xy / n - (x / n) * (y / n);
  // A few levels of contrast of its own draw the gain towards one.
  constexpr float kPrior = 20.0F;
  gain_ = std::clamp((covariance + kPrior) / (variance + kPrior), 1.0F / kMaxGain, kMaxGain);
  offset_ = y / n - gain_ * x / n;
  const SpreadSums spread = kPhotoBest.spread(look, points, {gain_, offset_, sigma_});
  sigma_ = std::max(kLeastSigma, std::sqrt(spread.squared / spread.count));
}

void PhotoTerm::accumulate(const Se3& T_odom_camera, int level, Matrix6d& information,
                           Vector6d& gradient) noexcept {
  if (keyframe_ == nullptr) return;
  follow_brightness(T_odom_camera, level);
  const PhotoLook look =
      look_at(frame_->level(level), T_reference_odom_ * T_odom_camera, T_gray_depth_);
  const PhotoEquations sums =
      kPhotoBest.equations(look, keyframe_->points(level), {gain_, offset_, sigma_});
  seen_ = sums.seen;
  kept_ = sums.kept;
  if (seen_ < kMinPoints) return;
  const double scale = 1.0 / (static_cast<double>(sigma_) * sigma_ * inflation_);
  const Eigen::Matrix<float, 6, 6> whole = sums.H.selfadjointView<Eigen::Lower>();
  information += scale * whole.cast<double>();
  gradient += scale * sums.b.cast<double>();
}

void PhotoTerm::add_scores(const Se3& T_odom_camera, ScoreBlocks& blocks) noexcept {
  if (keyframe_ == nullptr || seen_ < kMinPoints) return;
  const CameraModel& camera = frame_->level(0).camera;
  const double scale = 1.0 / (static_cast<double>(sigma_) * sigma_);
  ScoreBlocks own;
  Matrix6d information = Matrix6d::Zero();
  visit(T_odom_camera, 0,
        [&](const PhotoPoint& point, float intensity, const Eigen::Vector3f& slope,
            const Eigen::Vector3f& p, float u, float v) {
          const float residual = intensity - gain_ * point.intensity - offset_;
          const double w = scale * photo_weight(residual, sigma_);
          Vector6d J;
          J << slope.cast<double>(), p.cross(slope).cast<double>();
          const Vector6d score = (w * residual) * J;
          const auto block = score_block(u, v, camera.width_px, camera.height_px);
          own.add(block, score);
          blocks.add(block, score / inflation_, inflation_ * 2.0 / (kPhotoTailDof + 1.0));
          information += (w * J) * J.transpose();
        });
  Vector6d unit;
  unit << Eigen::Vector3d::Constant(0.05), Eigen::Vector3d::Constant(0.05);
  measured_inflation_ = own.inflation(information, unit);
}

}  // namespace maplet
