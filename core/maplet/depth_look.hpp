// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <utility>

#include "core/maplet/kept_depth.hpp"

namespace maplet {

/// What a keyframe's depth image says of a point: surface there, or was it seen through?
///
/// Time   O(1) a point.  Math  docs/math/maplet.md, eq. 6.
class DepthLook {
 public:
  enum class Seen : std::uint8_t { kNothing, kSurface, kThrough };

  /// @param fit_m  what a surface's patches are off its plane
  DepthLook(const KeptDepth& depth, double fit_m) noexcept
      : depth_{&depth},
        fx_{static_cast<float>(depth.camera().fx_px)},
        fy_{static_cast<float>(depth.camera().fy_px)},
        cx_{static_cast<float>(depth.camera().cx_px + 0.5)},
        cy_{static_cast<float>(depth.camera().cy_px + 0.5)},
        width_{static_cast<float>(depth.camera().width_px)},
        height_{static_cast<float>(depth.camera().height_px)},
        limit_m_{static_cast<float>(2.0 * fit_m)} {}

  /// A point, or a step between points, as pixels times its depth, and the depth: linear, so that
  /// steps may be added.
  /// @param p  camera frame, m
  [[nodiscard]] Eigen::Vector3f pixels(const Eigen::Vector3d& p) const noexcept {
    const Eigen::Vector3f f = p.cast<float>();
    return {fx_ * f.x() + cx_ * f.z(), fy_ * f.y() + cy_ * f.z(), f.z()};
  }

  /// Which of the points h, h + step, ... h + (count - 1) step may be in view: [first, last).
  [[nodiscard]] std::pair<int, int> in_view(const Eigen::Vector3f& h, const Eigen::Vector3f& step,
                                            int count) const noexcept {
    float first = 0.0F;
    float last = static_cast<float>(count - 1);
    const auto hold = [&](float at, float growth) {  // at + k growth >= 0
      if (growth > 0.0F) {
        first = std::max(first, -at / growth);
      } else if (growth < 0.0F) {
        last = std::min(last, -at / growth);
      } else if (at < 0.0F) {
        last = -1.0F;
      }
    };
    hold(h.z() - kNearest_m, step.z());
    hold(h.x(), step.x());
    hold(h.y(), step.y());
    hold(width_ * h.z() - h.x(), width_ * step.z() - step.x());
    hold(height_ * h.z() - h.y(), height_ * step.z() - step.y());
    if (!(first <= last)) return {0, 0};
    return {static_cast<int>(first), static_cast<int>(last) + 1};
  }

  /// @param h  of pixels()
  [[nodiscard]] Seen at(const Eigen::Vector3f& h) const noexcept {
    const float z = h.z();
    if (z < kNearest_m) return Seen::kNothing;
    const float inverse = 1.0F / z;
    const float x = h.x() * inverse;
    const float y = h.y() * inverse;
    if (!(x >= 0.0F && y >= 0.0F && x < width_ && y < height_)) return Seen::kNothing;
    const float z_m = depth_->at(static_cast<int>(x), static_cast<int>(y));
    if (z_m == 0.0F) return Seen::kNothing;
    const float off_m = z_m - z;
    const float limit_m = limit_m_ + kNoise * z * z;
    if (off_m > limit_m) return Seen::kThrough;
    return off_m >= -limit_m ? Seen::kSurface : Seen::kNothing;
  }

 private:
  static constexpr float kNearest_m = 0.4F;
  static constexpr float kNoise = 0.004F;  // 1/m: of depth, it grows with the square

  const KeptDepth* depth_;
  float fx_, fy_, cx_, cy_, width_, height_;
  float limit_m_;
};

/// How often a cell was looked at.
struct CellLooks {
  std::uint16_t surface = 0;
  std::uint16_t through = 0;

  void count(DepthLook::Seen seen) noexcept {
    if (seen == DepthLook::Seen::kSurface) ++surface;
    if (seen == DepthLook::Seen::kThrough) ++through;
  }
};

/// Whether it is surface after so many looks: also if one more had gone through it, where any has.
[[nodiscard]] constexpr bool is_surface(int surface, int through, double max_free_share) noexcept {
  if (surface == 0) return false;
  return through == 0 || through + 1 <= max_free_share * (surface + through);
}

}  // namespace maplet
