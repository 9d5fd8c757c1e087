// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "core/base/arena.hpp"
#include "core/geometry/se3.hpp"
#include "core/odometry/gray_pyramid.hpp"
#include "core/odometry/photo_view.hpp"
#include "core/odometry/pose_information.hpp"

namespace maplet {

/// How well a keyframe's points keep their intensity in the present frame: the photometric part of
/// an alignment. Brightness may change as a whole, by a gain and an offset.
///
/// Memory   inside the object.
/// Time     accumulate(): O(points).
/// Threads  one caller at a time.
/// Math     docs/math/odometry.md, eq. 16-19 (DVO: t-distribution of intensity residuals)
class PhotoTerm {
 public:
  /// Begins a frame. Without gray on either side the term is empty.
  /// @param inflation  what the points' information is divided by
  void begin(const GrayPyramid& frame, const PhotoView& keyframe, const Se3& T_reference_odom,
             const Se3& T_gray_depth, double inflation) noexcept;
  void end() noexcept { keyframe_ = nullptr; }

  [[nodiscard]] bool empty() const noexcept { return keyframe_ == nullptr; }

  /// Adds the normal equations at T (tangent of camera), at a level of the pyramid.
  void accumulate(const Se3& T_odom_camera, int level, Matrix6d& information,
                  Vector6d& gradient) noexcept;

  /// Adds the points' scores of the finest level to the blocks of the whole evidence.
  void add_scores(const Se3& T_odom_camera, ScoreBlocks& blocks) noexcept;

  /// Points that were seen, and the share of them that kept their intensity.
  [[nodiscard]] int seen() const noexcept { return seen_; }
  [[nodiscard]] double kept() const noexcept { return seen_ > 0 ? kept_ / seen_ : 0.0; }
  /// What the points' own disagreement says the information should be divided by.
  [[nodiscard]] double measured_inflation() const noexcept { return measured_inflation_; }

 private:
  template <class Visit>
  void visit(const Se3& T_odom_camera, int level, Visit&& take) const noexcept;
  void follow_brightness(const Se3& T_odom_camera, int level) noexcept;

  const GrayPyramid* frame_ = nullptr;
  const PhotoView* keyframe_ = nullptr;
  Se3 T_reference_odom_;
  Se3 T_gray_depth_;
  double inflation_ = 1.0;
  double measured_inflation_ = 1.0;
  float gain_ = 1.0F;
  float offset_ = 0.0F;
  float sigma_ = 10.0F;  ///< of the intensity, 0..255
  int seen_ = 0;
  double kept_ = 0.0;
};

}  // namespace maplet
