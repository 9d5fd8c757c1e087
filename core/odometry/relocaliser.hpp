// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/base/static_vector.hpp"
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
  bool stored = false;   ///< in a stored view, not in a keyframe
  bool telling = false;  ///< more than bare walls agree
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
  static constexpr std::size_t kRound = 96;

  Relocaliser(const OdometryConfig& config, Arena& arena);

  /// Stored views from now on; must outlive this.
  void look_through(ViewSource& views) noexcept { views_ = &views; }

  using Recognitions = StaticVector<Recognition, kTries>;
  /// First the keyframe that shows most of the frame as it is; then goes on where the last call
  /// ended. @param most  ends after so many recognitions
  [[nodiscard]] Recognitions run(const PatchView& frame, const KeyframePool& pool,
                                 PatchAligner& aligner, PhotoTerm& no_photo,
                                 const Whereabouts& whereabouts, std::size_t most,
                                 Deadline deadline) noexcept;

  /// From here on it counts which views were passed over or tried.
  void begin_round() noexcept { passed_ = 0; }
  /// Enough of them were, since then: of keyframes and stored views kRound, or all if there are
  /// fewer; as many as there are keyframes where what was found is `near` to what was expected.
  [[nodiscard]] bool round_complete(const KeyframePool& pool, bool near) const noexcept {
    return passed_ >= std::min(all(pool), near ? pool.size() : kRound);
  }

 private:
  static constexpr std::size_t kNothing = static_cast<std::size_t>(-1);

  [[nodiscard]] std::size_t all(const KeyframePool& pool) const noexcept {
    return pool.size() + (views_ == nullptr ? 0 : views_->count());
  }
  [[nodiscard]] StoredView place_of(const KeyframePool& pool, std::size_t which) const noexcept;
  [[nodiscard]] std::size_t likeliest(const PatchView& frame, const KeyframePool& pool,
                                      const Whereabouts& whereabouts) const noexcept;
  [[nodiscard]] bool recognise(const PatchView& frame, const Reference& reference,
                               PatchAligner& aligner, PhotoTerm& no_photo, Deadline deadline,
                               Alignment& out) const noexcept;

  OdometryConfig config_;
  ViewSource* views_ = nullptr;
  Arena::Owned<PatchSet> drawn_;
  PatchView drawn_view_;
  std::size_t next_ = 0;    ///< of the keyframes and stored views in one row
  std::size_t passed_ = 0;  ///< of these, since the round began
};

}  // namespace maplet
