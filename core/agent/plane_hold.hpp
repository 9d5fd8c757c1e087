// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "core/geometry/planar_motion.hpp"
#include "core/maplet/up_finder.hpp"
#include "core/odometry/track.hpp"

namespace maplet {

/// Keeps the camera of a vehicle in the plane of its floor (motion = planar), and says how well it
/// stays there. The first keyframe's view says which plane that is.
///
/// Memory   a value. Threads  one.
/// Math     docs/math/icap.md, eq. 20-22.
class PlaneHold {
 public:
  /// @param mounting  which way is up, as the first view is to be read
  explicit PlaneHold(const Mounting& mounting) noexcept : mounting_{mounting} {}

  [[nodiscard]] bool fixed() const noexcept { return planar_.has_value(); }
  /// A mission goes on, and its maplets say what plane it is in: the views of two starts would
  /// differ by what one of them is off.
  void go_on(const Eigen::Vector3d& up) noexcept;
  /// Before the first keyframe is made. @return the plane from now on
  const PlanarMotion& fix(const PatchSet& first_view) noexcept;
  /// Brings a frame's pose into the plane.
  void hold(Track& track) noexcept;

  /// What became of it.
  struct Report {
    Eigen::Vector3d up;    ///< unit, first camera's frame
    UpSource from;         ///< who said so
    double floor_off_rad;  ///< of the floor in the first view from an up that was given; else 0
    std::uint64_t off;     ///< frames that were seen off the plane since their keyframe
    std::uint64_t of;      ///< tracked frames
    static constexpr double kOff_m = 0.03;
    static constexpr double kOff_rad = 0.03;
  };
  [[nodiscard]] std::optional<Report> report() const noexcept;

 private:
  Mounting mounting_;
  UpSource from_ = UpSource::kMounting;
  std::optional<PlanarMotion> planar_;
  double floor_off_rad_ = 0.0;
  std::uint64_t off_ = 0;
  std::uint64_t of_ = 0;
};

}  // namespace maplet
