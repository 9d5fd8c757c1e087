// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/odometry/keyframe.hpp"
#include "core/odometry/keyframe_pool.hpp"
#include "core/odometry/motion_filter.hpp"
#include "core/odometry/odometry_config.hpp"
#include "core/odometry/patch_aligner.hpp"
#include "core/odometry/patch_view.hpp"
#include "core/odometry/track.hpp"

namespace maplet {

/// What happened so far, all counted.
struct TrackerCounters {
  std::uint64_t frames = 0;
  std::uint64_t lost = 0;         ///< frames without a pose
  std::uint64_t recovered = 0;    ///< the view was found again in a keyframe
  std::uint64_t segments = 0;     ///< gaps that were bridged by the motion prior alone
  std::uint64_t retried = 0;      ///< frames whose first start failed
  std::uint64_t not_forward = 0;  ///< frames whose stamp did not go forward
};

/// Tracks the camera frame by frame against keyframes.
///
/// The first usable frame is the origin and a keyframe. Without enough agreement with the keyframes
/// the track is lost; it goes on when a keyframe is recognised, or after config.lost_frames usable
/// frames in a new segment, whose first keyframe carries the covariance of the gap.
///
/// Memory   fixed, from the arena.
/// Time     O(iterations * references * patches); overruns the deadline by one iteration at most.
/// Threads  one caller at a time.
/// Math     docs/math/odometry.md.
class Tracker {
 public:
  Tracker(const OdometryConfig& config, Arena& arena);

  [[nodiscard]] Track run(const DepthFrame& frame, const PatchSet& patches,
                          Deadline deadline) noexcept;

  /// Makes a keyframe of the frame just tracked; the one to call when track.keyframe_due.
  /// @return valid until the next call
  const Keyframe& make_keyframe(const DepthFrame& frame, const PatchSet& patches,
                                const Track& track) noexcept;

  [[nodiscard]] const TrackerCounters& counters() const noexcept { return counters_; }

 private:
  [[nodiscard]] bool usable(const Alignment& alignment) const noexcept;
  [[nodiscard]] Alignment search(const KeyframePool::References& references, const PosePrior& prior,
                                 Deadline deadline) noexcept;
  [[nodiscard]] bool relocalise(const PosePrior& prior, Alignment& out, Deadline deadline) noexcept;
  [[nodiscard]] bool keyframe_due(const Track& track, const Alignment& alignment) noexcept;
  void accept(const Alignment& alignment, Track& track) noexcept;
  void lose(Track& track) noexcept;
  void begin_segment(Track& track) noexcept;

  OdometryConfig config_;
  PatchView view_;
  PatchAligner aligner_;
  KeyframePool pool_;
  MotionFilter filter_;
  TrackerCounters counters_;
  Stamp last_stamp_{};
  bool lost_ = false;
  int usable_while_lost_ = 0;
  std::size_t next_slot_ = 0;  ///< to look for the view in, while lost
  std::uint32_t segment_ = 0;
  std::uint32_t next_id_ = 0;
  bool first_after_keyframe_ = true;
  double first_log_information_ = 0.0;  ///< log determinant at the keyframe's first match
};

}  // namespace maplet
