// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/odometry/keyframe_pool.hpp"
#include "core/odometry/odometry_config.hpp"
#include "core/odometry/patch_aligner.hpp"
#include "core/odometry/patch_view.hpp"
#include "core/odometry/view_source.hpp"

namespace maplet {

/// Where a camera may be whose view is looked for, and what it may be recognised in.
struct Whereabouts {
  Se3 T_odom_camera;
  Matrix6d covariance = Matrix6d::Zero();  ///< in its own segment; tangent of camera
  std::uint32_t segment = 0;
  bool this_segment = true;         ///< views of it count
  bool other_segments = false;      ///< those of the others do
  Matrix6d gap = Matrix6d::Zero();  ///< between them and this one, the same tangent
};

struct Recognition {
  Alignment alignment;
  std::uint32_t segment = 0;
  bool stored = false;  ///< in a stored view, not in a keyframe
};

/// Looks for a view in the keyframes of the pool and in stored views, a few of them a frame, only
/// where the camera may be. Recognised is what overlaps well, leaves nothing free and lies within
/// the chi-square of the whereabouts.
///
/// Memory   fixed, from the arena: a PatchSet and its view.
/// Time     O(views) to pass over those out of reach; kDraws drawings and kTries alignments at
/// most. Threads  one caller at a time. Math     docs/math/odometry.md, section "Lost and found"
class Relocaliser {
 public:
  static constexpr int kTries = 2;
  static constexpr int kDraws = 4;

  Relocaliser(const OdometryConfig& config, Arena& arena);

  /// Stored views from now on; must outlive this.
  void look_through(ViewSource& views) noexcept { views_ = &views; }

  /// First the keyframe that shows most of the frame as it is; then goes on where the last call
  /// ended.
  [[nodiscard]] bool run(const PatchView& frame, const KeyframePool& pool, PatchAligner& aligner,
                         PhotoTerm& no_photo, const Whereabouts& whereabouts, Deadline deadline,
                         Recognition& out) noexcept;

 private:
  static constexpr std::size_t kNothing = static_cast<std::size_t>(-1);

  [[nodiscard]] std::size_t likeliest(const PatchView& frame, const KeyframePool& pool,
                                      const Whereabouts& whereabouts) const noexcept;
  [[nodiscard]] bool recognise(const PatchView& frame, const Reference& reference,
                               PatchAligner& aligner, PhotoTerm& no_photo, Deadline deadline,
                               Alignment& out) const noexcept;

  OdometryConfig config_;
  ViewSource* views_ = nullptr;
  Arena::Owned<PatchSet> drawn_;
  PatchView drawn_view_;
  std::size_t next_ = 0;  ///< of the keyframes and stored views in one row
};

}  // namespace maplet
