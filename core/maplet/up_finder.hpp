// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string_view>

#include "core/base/field.hpp"
#include "core/odometry/keyframe.hpp"

namespace maplet {

/// Which way is up in a view: the normal of its dominant horizontal plane, a floor below or a
/// ceiling above.
/// @param expected  unit, camera's frame
/// @param within_rad  further from it a plane is no floor
/// @return unit, camera's frame; zero when no plane that large is there
[[nodiscard]] Eigen::Vector3d up_of(const PatchSet& set, const Eigen::Vector3d& expected,
                                    double within_rad) noexcept;

/// How the camera sits: what is known before the first view.
struct Mounting {
  Vector3OrAuto up;                          ///< in the first camera's frame, or auto
  Eigen::Vector3d expected{0.0, -1.0, 0.0};  ///< where auto looks for it, unit: a level camera's
};

/// Who said which way is up.
enum class UpSource : std::uint8_t { kGiven, kFloor, kMounting, kMission };
[[nodiscard]] std::string_view to_string(UpSource source) noexcept;

/// Up in the first view: as given; or what a floor or ceiling within 0.6 rad of the expected shows;
/// or the expected.
struct FirstUp {
  Eigen::Vector3d up;  ///< unit, camera's frame
  UpSource from;
};
[[nodiscard]] FirstUp first_up(const PatchSet& view, const Mounting& mounting) noexcept;

/// Up along a path: given at its start or found there, then followed, because odometry tilts. Lost
/// with the track; found again.
///
/// Memory  a value. Threads  one.
class UpFinder {
 public:
  explicit UpFinder(const Mounting& mounting) noexcept;

  /// Every keyframe, in order.
  void look(const Keyframe& keyframe) noexcept;
  /// Unit, camera's frame at an odometry pose of the newest keyframe's segment; zero = not known.
  [[nodiscard]] Eigen::Vector3d at(const Se3& T_odom_camera) const noexcept;

 private:
  Eigen::Vector3d up_odom_;  // of the first camera before the first keyframe
  bool started_ = false;
  bool known_ = false;
  std::uint32_t segment_ = 0;
};

}  // namespace maplet
