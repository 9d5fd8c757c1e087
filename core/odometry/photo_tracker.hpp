// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/base/arena.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/odometry/gray_pyramid.hpp"
#include "core/odometry/patch_aligner.hpp"
#include "core/odometry/photo_term.hpp"
#include "core/odometry/photo_view.hpp"
#include "core/odometry/running_ratio.hpp"

namespace maplet {

/// The gray side of a tracker: this frame's pyramid, the newest keyframe's points, and how much
/// intensities are worth beside patches, as it turned out so far.
///
/// Memory   fixed, from the arena.
/// Time     one pass over the image a frame.
/// Math     docs/math/odometry.md, section "Gray"
class PhotoTracker {
 public:
  PhotoTracker(bool enabled, Arena& arena) : enabled_{enabled}, pyramid_{arena}, points_{arena} {}

  /// A gray image that is the one before once more tells of another time: it is left out.
  void assign(const DepthFrame& frame) noexcept;
  void make_keyframe(const DepthFrame& frame, const PatchSet& patches,
                     const PatchView& view) noexcept {
    points_.assign(frame, patches, view, pyramid_, T_gray_depth_);
  }
  /// The term against the newest keyframe; empty where there is no gray.
  [[nodiscard]] PhotoTerm& against(const Se3& T_reference_odom) noexcept {
    term_.begin(pyramid_, points_, T_reference_odom, T_gray_depth_, inflation());
    return term_;
  }
  /// No term: where what is aligned to is not the newest keyframe.
  [[nodiscard]] PhotoTerm& none() noexcept {
    term_.end();
    return term_;
  }
  void learn(const Alignment& alignment) noexcept;

 private:
  [[nodiscard]] double inflation() const noexcept;
  [[nodiscard]] bool repeats(const ImageView<std::uint8_t>& gray) noexcept;

  bool enabled_;
  std::uint64_t last_image_ = 0;  ///< a sum over the last gray image
  GrayPyramid pyramid_;
  PhotoView points_;
  PhotoTerm term_;
  Se3 T_gray_depth_;
  double by_region_ = 20.0;  ///< inflation that the regions of the image ask for
  RunningRatio against_patches_{100.0, 6.0};
};

}  // namespace maplet
