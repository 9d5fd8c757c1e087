// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <string_view>

#include "core/odometry/photo_look.hpp"

namespace maplet {

/// How intensities of the keyframe become those of the frame, and how far they stray.
struct Brightness {
  float gain;
  float offset;
  float sigma;
};

/// Weight of an intensity's residual: t-distributed (eq. 16).
inline constexpr float kPhotoTailDof = 5.0F;
[[nodiscard]] inline float photo_weight(float residual, float sigma) noexcept {
  const float x = residual / sigma;
  return (kPhotoTailDof + 1.0F) / (kPhotoTailDof + x * x);
}
/// A point has kept its intensity within so many sigmas.
inline constexpr float kPhotoKeptSigmas = 2.5F;

/// Weighted sums of the points' intensities in the keyframe, x, and in the frame, y.
struct IntensitySums {
  float n = 0, x = 0, y = 0, xx = 0, xy = 0;
};

/// Weighted squares of the residuals.
struct SpreadSums {
  float squared = 0.0F;
  float count = 0.0F;
};

/// Normal equations of the pose (tangent of camera), not yet over sigma squared.
struct PhotoEquations {
  Eigen::Matrix<float, 6, 6> H = Eigen::Matrix<float, 6, 6>::Zero();  ///< lower triangle
  Eigen::Matrix<float, 6, 1> b = Eigen::Matrix<float, 6, 1>::Zero();
  int seen = 0;
  int kept = 0;
};

/// The passes over a keyframe's points that a frame spends its time on. Variants differ by
/// rounding.
///
/// Time   O(points).
/// Math   docs/math/odometry.md, eq. 16-18
struct PhotoVariant {
  using Points = std::span<const PhotoPoint>;
  std::string_view name;
  IntensitySums (*intensities)(const PhotoLook&, Points, const Brightness&) noexcept;
  SpreadSums (*spread)(const PhotoLook&, Points, const Brightness&) noexcept;
  PhotoEquations (*equations)(const PhotoLook&, Points, const Brightness&) noexcept;
};

/// The reference for the fast ones.
extern const PhotoVariant kPhotoPlain;
#if defined(__ARM_NEON)
extern const PhotoVariant kPhotoNeon;
inline const PhotoVariant& kPhotoBest = kPhotoNeon;
#else
inline const PhotoVariant& kPhotoBest = kPhotoPlain;
#endif

}  // namespace maplet
