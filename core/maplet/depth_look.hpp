// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>

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

  /// On which sides of the view a point is, one bit each: two points that have one in common have
  /// nothing of the line between them in view.
  [[nodiscard]] unsigned outside(const Eigen::Vector3f& p) const noexcept {
    const float x = fx_ * p.x() + cx_ * p.z();
    const float y = fy_ * p.y() + cy_ * p.z();
    return (p.z() < kNearest_m ? 1U : 0U) | (x < 0.0F ? 2U : 0U) | (y < 0.0F ? 4U : 0U) |
           (x >= width_ * p.z() ? 8U : 0U) | (y >= height_ * p.z() ? 16U : 0U);
  }

  /// @param p  camera frame, m
  [[nodiscard]] Seen at(const Eigen::Vector3f& p) const noexcept {
    if (p.z() < kNearest_m) return Seen::kNothing;
    const float inverse = 1.0F / p.z();
    const float x = fx_ * p.x() * inverse + cx_;
    const float y = fy_ * p.y() * inverse + cy_;
    if (!(x >= 0.0F && y >= 0.0F && x < width_ && y < height_)) return Seen::kNothing;
    const float z_m = depth_->at(static_cast<int>(x), static_cast<int>(y));
    if (z_m == 0.0F) return Seen::kNothing;
    const float off_m = z_m - p.z();
    const float limit_m = limit_m_ + kNoise * p.z() * p.z();
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
