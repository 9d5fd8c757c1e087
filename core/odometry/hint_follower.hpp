// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/static_vector.hpp"
#include "core/frame/motion_hint.hpp"
#include "core/geometry/se3.hpp"
#include "core/odometry/odometry_config.hpp"

namespace maplet {

/// A motion since the last tracked frame, as somebody else measured it.
struct HintedMotion {
  Se3 T_last_now;
  Matrix6d information = Matrix6d::Zero();  ///< tangent of now; a gyro knows no translation
  /// What a source that has frozen may have left out: it would have gone on like that.
  Vector6d missed = Vector6d::Zero();
};

/// External odometry and gyro: what they say since the last tracked frame, and whether they are to
/// be believed. Who contradicts what was seen three frames in a row is only watched from then on,
/// and believed again after it has agreed for a while. Who leaps farther than any camera moves, or
/// stands still from one frame to the next in full motion (a source that froze repeats its last
/// pose, its last twist ends in zeros), is not believed over a time in which nothing was seen.
///
/// Memory   inside the object.
/// Math     docs/math/odometry.md, section "Motion prior"
class HintFollower {
 public:
  enum Kind : std::uint8_t { kPose, kTurn };
  static constexpr std::size_t kKinds = 2;

  explicit HintFollower(const OdometryConfig& config) noexcept : config_{config} {}

  /// @return whether `kind` has something to say of the motion from the last tracked frame to now
  [[nodiscard]] bool motion(Kind kind, const MotionHint& now, HintedMotion& out) const noexcept;
  [[nodiscard]] bool believed(Kind kind) const noexcept { return states_[kind].believed; }
  /// Whether it leapt since the last tracked frame, or froze while nothing was seen.
  [[nodiscard]] bool broke_off(Kind kind) const noexcept {
    return states_[kind].leapt || (states_[kind].froze && frames_ > 1);
  }

  /// Every frame, tracked or not, before the others: what was said since the frame before.
  /// @param dt_s  since then; 0 if nobody knows
  void watch(const MotionHint& now, double dt_s) noexcept;
  /// The frame `now` was tracked: counts from here on.
  /// @param velocity  of the camera there, m/s and rad/s, tangent of camera
  void keep(const MotionHint& now, const Vector6d& velocity) noexcept;
  /// Compares what was seen with what was said over a longer way than a frame's: what is a few
  /// per cent of a step off, each time to the same side, is only seen there.
  /// @param free  tangents of camera along which nothing was seen but what hints filled: the rest
  ///   is compared
  void look_back(const MotionHint& now, const Se3& T_odom_camera,
                 std::span<const Vector6d> free) noexcept;
  /// A frame in which external odometry filled the free axes. Its share of error is the same all
  /// the way (a wheel's radius), not drawn anew for each step.
  /// @return what the covariance of the pose grows by because of that
  [[nodiscard]] Matrix6d rely(const HintedMotion& step, std::span<const Vector6d> free) noexcept;
  /// @param agreed  in this frame; what the last longer way showed is added
  /// @return whether both did
  bool judge(Kind kind, bool agreed) noexcept;

 private:
  struct State {
    bool believed = true;
    int streak = 0;  ///< of the opposite
    bool agreed_over_way = true;
    Vector6d rate = Vector6d::Zero();  ///< said lately, 1/s
    bool frozen = false;               ///< stands still since the rate was that
    // Since the last tracked frame:
    bool leapt = false;
    bool froze = false;
    Vector6d missed = Vector6d::Zero();
  };
  struct Way {  ///< since its beginning
    MotionHint hint;
    Se3 T_odom_camera;
    Matrix6d free = Matrix6d::Zero();  ///< projects on what was not seen in some frame of it
    bool begun = false;
  };
  [[nodiscard]] bool between(Kind kind, const MotionHint& from, const MotionHint& now,
                             HintedMotion& out) const noexcept;

  void watch(State& state, const Vector6d& step, double dt_s) noexcept;

  OdometryConfig config_;
  MotionHint last_;    ///< of the last tracked frame
  MotionHint before_;  ///< of the frame before
  bool known_ = false;
  // Since the last tracked frame, and how the camera moved there:
  int frames_ = 0;
  double seconds_ = 0.0;
  Vector6d velocity_ = Vector6d::Zero();
  Way way_;
  Vector6d relied_ = Vector6d::Zero();  ///< the way that hints alone have made, tangent of camera
  State states_[kKinds];
};

}  // namespace maplet
