// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/geometry/se3.hpp"
#include "core/odometry/gray_pyramid.hpp"
#include "core/odometry/patch_view.hpp"
#include "core/patches/patch.hpp"

namespace maplet {

/// A point whose intensity is looked for in another frame.
struct PhotoPoint {
  Eigen::Vector3f p;  ///< depth camera of the keyframe, m
  float intensity;    ///< 0..255
};

/// What the photometric term keeps of a keyframe: in each small block of the image the point of
/// steepest intensity that lies on a smooth surface, at each size of the pyramid.
///
/// Memory   fixed, from the arena: kMaxPoints points a level.
/// Time     assign(): O(pixels / 16).
class PhotoView {
 public:
  static constexpr std::size_t kMaxPoints = 1280;

  explicit PhotoView(Arena& arena);

  /// @param T_gray_depth  of the camera that made the pyramid's image
  /// @param view  of the same patches: what of it moves gives no points
  void assign(const DepthFrame& frame, const PatchSet& patches, const PatchView& view,
              const GrayPyramid& gray, const Se3& T_gray_depth) noexcept;
  void clear() noexcept { size_.fill(0); }

  [[nodiscard]] std::span<const PhotoPoint> points(int level) const noexcept {
    return points_[static_cast<std::size_t>(level)].first(size_[static_cast<std::size_t>(level)]);
  }
  [[nodiscard]] bool empty() const noexcept { return size_[0] == 0; }

 private:
  struct Best {
    float steepness;
    PhotoPoint point;
  };

  std::array<std::span<PhotoPoint>, GrayPyramid::kLevels> points_;
  std::array<std::size_t, GrayPyramid::kLevels> size_{};
  std::span<Best> best_;  ///< of each block, while one level is filled
};

}  // namespace maplet
