// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/photo_term.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr float kTailDof = 5.0F;
constexpr float kStartSigma = 12.0F;
constexpr float kLeastSigma = 2.0F;
constexpr float kMaxGain = 2.5F;
constexpr float kKeptSigmas = 2.5F;
constexpr int kMinPoints = 40;  // fewer say nothing of gain, offset and scale

float t_weight(float residual, float sigma) noexcept {
  const float x = residual / sigma;
  return (kTailDof + 1.0F) / (kTailDof + x * x);
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

// take(point, intensity here, in gray's camera: gradient by its position, position in camera,
// pixel)
template <class Visit>
void PhotoTerm::visit(const Se3& T_odom_camera, int level, Visit&& take) const noexcept {
  const Se3 T_camera_reference = (T_reference_odom_ * T_odom_camera).inverse();
  const Eigen::Matrix3f R = T_camera_reference.rotation().cast<float>();
  const Eigen::Vector3f t = T_camera_reference.t.cast<float>();
  const Eigen::Matrix3f R_gray = T_gray_depth_.rotation().cast<float>();
  const Eigen::Vector3f t_gray = T_gray_depth_.t.cast<float>();
  const GrayPyramid::Level& image = frame_->level(level);
  const int width = image.camera.width_px;
  const auto fx = static_cast<float>(image.camera.fx_px);
  const auto fy = static_cast<float>(image.camera.fy_px);
  const auto cx = static_cast<float>(image.camera.cx_px);
  const auto cy = static_cast<float>(image.camera.cy_px);
  const auto u_end = static_cast<float>(width - 1);
  const auto v_end = static_cast<float>(image.camera.height_px - 1);
  for (const PhotoPoint& point : keyframe_->points(level)) {
    const Eigen::Vector3f p = R * point.p + t;
    const Eigen::Vector3f g = R_gray * p + t_gray;
    if (!(g.z() > 0.1F)) continue;
    const float inverse = 1.0F / g.z();
    const float x = g.x() * inverse;
    const float y = g.y() * inverse;
    const float u = fx * x + cx;
    const float v = fy * y + cy;
    if (!(u >= 0.0F && v >= 0.0F && u < u_end && v < v_end)) continue;
    const int column = static_cast<int>(u);
    const int row = static_cast<int>(v);
    const float a = u - static_cast<float>(column);
    const float b = v - static_cast<float>(row);
    const std::uint8_t* q = image.pixels + row * width + column;
    const auto i00 = static_cast<float>(q[0]);
    const auto i10 = static_cast<float>(q[1]);
    const auto i01 = static_cast<float>(q[width]);
    const auto i11 = static_cast<float>(q[width + 1]);
    const float top = i00 + a * (i10 - i00);
    const float low = i01 + a * (i11 - i01);
    // Slopes of the bilinear surface through the four pixels, per unit of x/Z and y/Z.
    const float gu = fx * ((i10 - i00) + b * ((i11 - i01) - (i10 - i00)));
    const float gv = fy * (low - top);
    const Eigen::Vector3f by_gray{gu * inverse, gv * inverse, -(gu * x + gv * y) * inverse};
    take(point, top + b * (low - top), Eigen::Vector3f{R_gray.transpose() * by_gray}, p, u, v);
  }
}

// Eq. 17: gain and offset between the two images, and the residuals' scale, by weighted least
// squares with the present weights.
void PhotoTerm::follow_brightness(const Se3& T_odom_camera, int level) noexcept {
  float n = 0, x = 0, y = 0, xx = 0, xy = 0;
  visit(T_odom_camera, level, [&](const PhotoPoint& point, float intensity, auto&&...) {
    const float w = t_weight(intensity - gain_ * point.intensity - offset_, 2.0F * sigma_);
    n += w;
    x += w * point.intensity;
    y += w * intensity;
    xx += w * point.intensity * point.intensity;
    xy += w * point.intensity * intensity;
  });
  if (n < kMinPoints) return;
  const float variance = xx / n - (x / n) * (x / n);
  const float covariance = xy / n - (x / n) * (y / n);
  // A few levels of contrast of its own draw the gain towards one.
  constexpr float kPrior = 100.0F;
  gain_ = std::clamp((covariance + kPrior) / (variance + kPrior), 1.0F / kMaxGain, kMaxGain);
  offset_ = y / n - gain_ * x / n;
  float squared = 0.0F;
  float count = 0.0F;
  visit(T_odom_camera, level, [&](const PhotoPoint& point, float intensity, auto&&...) {
    const float residual = intensity - gain_ * point.intensity - offset_;
    squared += t_weight(residual, sigma_) * residual * residual;
    count += 1.0F;
  });
  sigma_ = std::max(kLeastSigma, std::sqrt(squared / count));
}

void PhotoTerm::accumulate(const Se3& T_odom_camera, int level, Matrix6d& information,
                           Vector6d& gradient) noexcept {
  if (keyframe_ == nullptr) return;
  follow_brightness(T_odom_camera, level);
  Eigen::Matrix<float, 6, 6> H = Eigen::Matrix<float, 6, 6>::Zero();
  Eigen::Matrix<float, 6, 1> b = Eigen::Matrix<float, 6, 1>::Zero();
  seen_ = 0;
  kept_ = 0.0;
  visit(T_odom_camera, level,
        [&](const PhotoPoint& point, float intensity, const Eigen::Vector3f& slope,
            const Eigen::Vector3f& p, float, float) {
          const float residual = intensity - gain_ * point.intensity - offset_;
          const float w = t_weight(residual, sigma_);
          Eigen::Matrix<float, 6, 1> J;  // of minus the residual
          J.head<3>() = slope;
          J.tail<3>() = p.cross(slope);
          const Eigen::Matrix<float, 6, 1> wJ = w * J;
          H.triangularView<Eigen::Lower>() += wJ * J.transpose();
          b += wJ * residual;
          ++seen_;
          if (std::abs(residual) < kKeptSigmas * sigma_) kept_ += 1.0;
        });
  if (seen_ < kMinPoints) return;
  const double scale = 1.0 / (static_cast<double>(sigma_) * sigma_ * inflation_);
  const Eigen::Matrix<float, 6, 6> whole = H.selfadjointView<Eigen::Lower>();
  information += scale * whole.cast<double>();
  gradient += scale * b.cast<double>();
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
          const double w = scale * t_weight(residual, sigma_);
          Vector6d J;
          J << slope.cast<double>(), p.cross(slope).cast<double>();
          const Vector6d score = (w * residual) * J;
          const auto block = score_block(u, v, camera.width_px, camera.height_px);
          own.add(block, score);
          blocks.add(block, score / inflation_);
          information += (w * J) * J.transpose();
        });
  Vector6d unit;
  unit << Eigen::Vector3d::Constant(0.05), Eigen::Vector3d::Constant(0.05);
  measured_inflation_ = own.inflation(information, unit);
}

}  // namespace maplet
