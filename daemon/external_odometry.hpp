// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "core/base/clock.hpp"
#include "core/frame/motion_path.hpp"
#include "core/odometry/odometry_config.hpp"
#include "transport/ros2/odometry_inbox.hpp"

namespace maplet::daemon {

/// Somebody else's odometry, made into what the tracker takes as a prior of the motion: looked at
/// number by number, one publisher at a time, put in order, carried from the base to the camera.
///
/// Only differences count, so where the way itself is broken off (another publisher, a leap, a
/// clock that began anew) nothing is said until a frame was tracked after it: what is lost in the
/// dark is not found again by a leap.
///
/// Memory   a ring of kKept. Threads  the estimator's; counters by any.
/// Math     docs/math/odometry.md, section "Motion prior"; covariances docs/ros2.md
class ExternalOdometry {
 public:
  static constexpr std::size_t kKept = 256;
  static constexpr Duration kMostHole = std::chrono::milliseconds{200};
  /// What came last is good for that long.
  static constexpr Duration kMostAhead = std::chrono::milliseconds{40};
  static constexpr Duration kLeast = std::chrono::milliseconds{2};  ///< between two: 500 Hz
  static constexpr Duration kSameClock = std::chrono::seconds{5};

  ExternalOdometry(const OdometryConfig& config, const Se3& T_base_camera) noexcept;

  /// @param now  the frames' time in the clock of the stamps
  void take(const OdometryReport& report, Stamp now) noexcept;
  /// What is known of the motion at a moment: nothing where there is no report within kMostHole
  /// around it, or kMostAhead before it. Time: O(log kKept).
  [[nodiscard]] MotionHint at(Stamp stamp) noexcept;
  /// The frame that at() was asked for last was tracked.
  void tracked() noexcept { segment_tracked_ = segment_asked_; }

  /// Reports, each in one of them.
  enum class Verdict : std::uint8_t {
    kUsed,
    kMalformed,       ///< not finite, no rotation, beyond all places
    kOtherClock,      ///< its stamp has nothing to do with the frames'
    kBackwards,       ///< not after the one before
    kTooOften,        ///< more than 500 a second
    kLeapt,           ///< nothing moves like that
    kOtherPublisher,  ///< two publish at once: the first has the word
  };
  static constexpr std::size_t kVerdicts = 7;
  struct Counters {
    std::array<std::uint64_t, kVerdicts> by_verdict{};
    std::uint64_t restarts = 0;          ///< of the way
    std::uint64_t covariances_left = 0;  ///< that were none
  };
  [[nodiscard]] Counters counters() const noexcept;

 private:
  struct Kept {
    MotionPose pose;
    std::uint32_t segment = 0;
  };
  [[nodiscard]] Verdict judge(const OdometryReport& report, Stamp now) noexcept;
  [[nodiscard]] bool steps_as_a_robot(const Se3& from, const Se3& to, Duration dt) const noexcept;
  [[nodiscard]] Matrix6d step_covariance(const OdometryReport& report, double dt_s) noexcept;
  void keep(const OdometryReport& report, const Se3& T_external_base) noexcept;
  void restart() noexcept;
  [[nodiscard]] const Kept& kept(std::size_t i) const noexcept {  // 0: the oldest
    return ring_[(first_ + i) % kKept];
  }

  OdometryConfig config_;
  Se3 T_base_camera_;
  Matrix6d to_camera_;  ///< tangents
  std::array<Kept, kKept> ring_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::uint64_t writer_ = 0;
  Stamp newest_{};
  Se3 T_external_base_;                          ///< of the newest
  Matrix6d body_covariance_ = Matrix6d::Zero();  ///< as it said, tangent of base
  Vector6d last_step_ = Vector6d::Zero();
  std::uint32_t segment_ = 1;
  std::uint32_t segment_asked_ = 0;
  std::uint32_t segment_tracked_ = 0;
  int backwards_in_a_row_ = 0;
  Stamp last_backwards_{};
  Se3 T_leapt_to_;
  Stamp leapt_at_{};
  int agreed_there_ = 0;

  std::array<std::atomic<std::uint64_t>, kVerdicts> by_verdict_{};
  std::atomic<std::uint64_t> restarts_{0};
  std::atomic<std::uint64_t> covariances_left_{0};
};

}  // namespace maplet::daemon
