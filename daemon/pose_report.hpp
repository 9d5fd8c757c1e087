// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/agent/agent.hpp"
#include "daemon/output_frames.hpp"

namespace maplet::daemon {

/// Where the robot is after one frame, for programs outside. A value, about 1 KB.
struct PoseReport {
  Stamp stamp{};              ///< the source's
  std::int64_t stamp_ns = 0;  ///< the same in the clock of what goes out
  Instant came{};             ///< when the frame was here
  bool tracking = false;
  bool partly_free = false;     ///< along some direction nothing was seen
  bool moves = false;           ///< `inside.twist` is known
  std::uint32_t resets = 0;     ///< how often odometry did not go on from where it was
  std::uint64_t map_jumps = 0;  ///< MapFrame::Notice::jumps
  OutsidePose inside;           ///< camera's axes
  OutsidePose enu_flu;          ///< of the body
  Se3 T_map_world;              ///< outside's map from the skeleton's world, enu_flu
  // The newest maplet of ours that the skeleton knows, where there is one.
  bool anchored = false;
  MapletKey anchor;
  Se3 T_anchor_base;
};

/// Makes the report of each frame: odometry's covariance since the start, its velocity, its breaks.
///
/// Covariance: keyframe by keyframe, each alignment's error taken as independent of the others. It
/// grows with the way and never shrinks: a place that was recognised does not say how far odometry
/// had gone astray before.
///
/// Memory   a value. Threads  the estimator's. Time  O(1), about 3 us.
class PoseReporter {
 public:
  PoseReporter(const Se3& T_body_camera, const Vector3OrAuto& up) noexcept
      : frames_{T_body_camera, up} {}

  /// @param step  of a frame; its loans are looked at here
  [[nodiscard]] PoseReport report(const Step& step, const Agent& agent) noexcept;
  [[nodiscard]] const OutputFrames& frames() const noexcept { return frames_; }

 private:
  [[nodiscard]] bool broke(const Track& track, const TrackerCounters& counted) noexcept;
  void move(const Track& track, OutsidePose& inside, bool& known) noexcept;

  OutputFrames frames_;
  Matrix6d keyframe_covariance_ = Matrix6d::Zero();  ///< of T_odom_keyframe, tangent of keyframe
  std::uint32_t resets_ = 0;
  std::uint64_t gaps_ = 0;
  bool begun_ = false;
  MapletKey newest_;
  bool newest_known_ = false;
  struct Before {
    Stamp stamp{};
    Se3 T_odom_camera;
    Matrix6d covariance = Matrix6d::Zero();  ///< since the keyframe
  };
  std::optional<Before> before_;  ///< the frame before was tracked, and odometry went on
};

}  // namespace maplet::daemon
