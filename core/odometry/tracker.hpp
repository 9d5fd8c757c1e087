// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/odometry/contenders.hpp"
#include "core/odometry/hint_follower.hpp"
#include "core/odometry/keyframe.hpp"
#include "core/odometry/keyframe_pool.hpp"
#include "core/odometry/motion_filter.hpp"
#include "core/odometry/odometry_config.hpp"
#include "core/odometry/patch_aligner.hpp"
#include "core/odometry/patch_view.hpp"
#include "core/odometry/photo_tracker.hpp"
#include "core/odometry/relocaliser.hpp"
#include "core/odometry/running_ratio.hpp"
#include "core/odometry/stamp_jitter.hpp"
#include "core/odometry/track.hpp"

namespace maplet {

/// What happened so far, all counted.
struct TrackerCounters {
  std::uint64_t frames = 0;
  std::uint64_t lost = 0;             ///< frames without a pose
  std::uint64_t recovered = 0;        ///< the view was found again in a keyframe
  std::uint64_t segments = 0;         ///< gaps that were bridged by the motion prior alone
  std::uint64_t leaps = 0;            ///< stamps so far ahead that anything may have happened
  std::uint64_t returned = 0;         ///< an older keyframe showed that the track had strayed
  std::uint64_t tied = 0;             ///< segments that were recognised in an earlier one
  std::uint64_t in_stored_views = 0;  ///< recognitions in no keyframe, but in a stored view
  std::uint64_t with_moving = 0;      ///< frames a tenth of which did not stand still
  std::uint64_t retried = 0;          ///< frames whose first start failed
  std::uint64_t not_forward = 0;      ///< frames whose stamp did not go forward
  std::uint64_t hints_used = 0;       ///< external motions that the prior took in
  std::uint64_t hints_refused = 0;    ///< those that contradicted what was expected or seen
  std::uint64_t with_gray = 0;        ///< frames in which intensities took part
  std::array<std::uint64_t, kLosses> by_loss{};  ///< lost frames by Loss
};

/// Tracks the camera frame by frame against keyframes.
///
/// The first usable frame is the origin and a keyframe. Without enough agreement with the keyframes
/// the track is lost; it goes on when a keyframe or a stored view is recognised, or after
/// config.lost_frames usable frames in a new segment, whose first keyframe carries the covariance
/// of the gap. When the view of an earlier segment comes up in a new one, the track goes on there.
/// After so long that the camera may have turned to another wall, several frames must say where it
/// is (Contenders).
///
/// Memory   fixed, from the arena.
/// Time     O(iterations * references * patches); overruns the deadline by one iteration at most.
/// Threads  one caller at a time.
/// Math     docs/math/odometry.md.
class Tracker {
 public:
  Tracker(const OdometryConfig& config, Arena& arena);

  /// Where else to look for a lost view, besides keyframes; must outlive the tracker.
  void look_through(ViewSource& views) noexcept { relocaliser_.look_through(views); }

  [[nodiscard]] Track run(const DepthFrame& frame, const PatchSet& patches,
                          Deadline deadline) noexcept;

  /// Makes a keyframe of the frame just tracked; the one to call when track.keyframe_due.
  /// @return valid until the next call
  const Keyframe& make_keyframe(const DepthFrame& frame, const PatchSet& patches,
                                const Track& track) noexcept;

  [[nodiscard]] const TrackerCounters& counters() const noexcept { return counters_; }

 private:
  static constexpr double kSearchSlackM = 0.1;  // how far off another start may be
  static constexpr double kSearchSlackRad = 0.1;
  static constexpr double kVideoS = 0.11;  // between frames that hardly differ

  struct Guess {  ///< where else the camera may be, from a hint that contradicts the prediction
    bool any = false;
    Se3 T_odom_camera;
  };

  [[nodiscard]] const PatchView& view() const noexcept { return views_[now_]; }
  void predict(Stamp stamp) noexcept;
  void take_hints(const MotionHint& hint, Guess& guess) noexcept;
  void judge_hints(const MotionHint& hint, const Alignment& alignment) noexcept;
  [[nodiscard]] KeyframePool::References references() noexcept;
  [[nodiscard]] Alignment align(const KeyframePool::References& references, const PosePrior& prior,
                                const Guess& guess, Deadline deadline) noexcept;
  [[nodiscard]] Alignment try_from(const KeyframePool::References& references,
                                   const PosePrior& prior, const Start& start, PhotoTerm& photo,
                                   Deadline deadline) noexcept;
  [[nodiscard]] Alignment refine(const KeyframePool::References& references,
                                 const Alignment& patches, PosePrior prior,
                                 Deadline deadline) noexcept;
  [[nodiscard]] PhotoTerm& gray() noexcept;
  [[nodiscard]] Alignment search(const KeyframePool::References& references, const PosePrior& prior,
                                 Deadline deadline) noexcept;
  [[nodiscard]] static double anywhere_s(const OdometryConfig& config) noexcept;
  [[nodiscard]] bool may_be_anywhere(Stamp stamp) const noexcept;
  [[nodiscard]] bool relocalise(Alignment& out, double better_than, Deadline deadline) noexcept;
  [[nodiscard]] bool find_out(Alignment& out, Deadline deadline) noexcept;
  [[nodiscard]] int patience() const noexcept;
  void return_to_older(const KeyframePool::References& references, Alignment& out,
                       Deadline deadline) noexcept;
  void take_place(const Recognition& found) noexcept;
  void jump_to(const Se3& T_odom_camera) noexcept;
  [[nodiscard]] Loss blindness(const PatchSet& patches) const noexcept;
  [[nodiscard]] Loss trouble(const Alignment& alignment, Stamp stamp) const noexcept;
  [[nodiscard]] bool changed_at_once(const Alignment& alignment, Stamp stamp) const noexcept;
  [[nodiscard]] bool moves_like_a_camera(const Alignment& alignment, Stamp stamp) const noexcept;
  [[nodiscard]] Matrix6d gap() const noexcept;
  [[nodiscard]] bool keyframe_due(const Track& track, const Alignment& alignment) noexcept;
  void doubt(double moving_share, Track& track) noexcept;
  void accept(const DepthFrame& frame, const Alignment& alignment, Track& track) noexcept;
  void lose(Loss why, Track& track) noexcept;
  void stand_at_prediction(Track& track) noexcept;
  void begin_segment(const DepthFrame& frame, Track& track) noexcept;

  OdometryConfig config_;
  std::array<PatchView, 2> views_;  ///< of the present frame and of the one before
  std::size_t now_ = 0;
  bool has_previous_ = false;
  Se3 T_odom_last_;  ///< of the last tracked frame
  PatchAligner aligner_;
  KeyframePool pool_;
  PhotoTracker photo_;
  Relocaliser relocaliser_;
  MotionFilter filter_;
  HintFollower hints_;
  std::optional<HintedMotion> relied_on_;  ///< external odometry that this frame's prior took in
  TrackerCounters counters_;
  RunningRatio disagreement_;  ///< of keyframes: squared, over what was to be expected
  Stamp last_stamp_{};
  Stamp tracked_stamp_{};  ///< of the last tracked frame
  /// Of the last tracked frame since the newest keyframe.
  Matrix6d tracked_covariance_ = Matrix6d::Zero();
  int backward_ = 0;  ///< frames in a row whose stamp did not go forward
  StampJitter jitter_;
  double usual_step_s_ = 0.0;     ///< between frames
  double usual_agreement_ = 0.0;  ///< of tracked frames
  Contenders contenders_;
  bool lost_ = false;
  bool unexplained_ = false;  ///< this loss began with a view that fitted nothing
  int usable_while_lost_ = 0;
  int lost_in_a_row_ = 0;
  std::uint32_t blind_spells_ = 0;
  std::uint32_t segment_ = 0;
  std::uint32_t next_segment_ = 1;
  /// Of the gaps between this segment and the one before; none in the first segment.
  Matrix6d gap_covariance_ = Matrix6d::Zero();
  double moving_ = 0.0;  ///< share of the last frame that did not stand still
  double moved_ = 0.0;  ///< squared shares of the view that did not stand still, since the keyframe
  int frames_to_return_ = 0;             ///< until an older keyframe is tried alone again
  Matrix6d strayed_ = Matrix6d::Zero();  ///< this frame's correction, as a covariance
  bool recognised_ = false;              ///< this frame, where there may be no keyframe
  bool crossed_ = false;                 ///< this frame, in another segment
  Se3 T_odom_before_;                    ///< then: what was before, as odometry has it now
  std::uint32_t next_id_ = 0;
  bool first_after_keyframe_ = true;
  double first_log_information_ = 0.0;  ///< log determinant at the keyframe's first match
};

}  // namespace maplet
