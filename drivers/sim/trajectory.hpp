// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/geometry/se3.hpp"
#include "drivers/sim/options.hpp"
#include "drivers/sim/world.hpp"

namespace maplet::sim {

/// A closed, smooth path through a world as a function of time: speed and yaw rate stay under the
/// limits everywhere, the camera stays roughly level.
///
/// The time law: at each place of the curve the slowness (s per curve parameter) that the limits
/// ask for, its maximum over a window, then the mean over the same window: never below what is
/// asked for, and smooth.
///
/// Memory   tables made by the constructor; at() allocates nothing.
/// Time     at(): O(log(samples)).
class Trajectory {
 public:
  Trajectory(const Route& route, const SimOptions& options);

  /// @param time_s from the first frame; rounds repeat, the wobble does not
  [[nodiscard]] Se3 at(double time_s) const noexcept;  ///< T_world_camera
  [[nodiscard]] double round_s() const noexcept { return times_.back(); }
  [[nodiscard]] double round_m() const noexcept { return length_m_; }

 private:
  struct Place {
    Eigen::Vector3d p;
    Eigen::Vector3d velocity;  ///< per curve parameter
    double yaw;
    double yaw_rate;  ///< per curve parameter
  };
  struct Wave {
    double amplitude;
    double rate_rad_per_s;
    double phase_rad;
  };

  [[nodiscard]] Place place(double s) const noexcept;
  [[nodiscard]] double parameter_at(double time_s) const noexcept;
  [[nodiscard]] double wobble(const Wave& wave, double time_s) const noexcept;
  void make_waves(const SimOptions& options);
  void make_times(double speed, double yaw_rate);

  Route route_;
  double turn_rad_;               ///< yaw gained in a round
  std::array<Wave, 6> waves_{};   ///< height, sideways, yaw, pitch, pitch, roll
  std::vector<double> slowness_;  ///< s per curve parameter, at the samples
  std::vector<double> times_;     ///< when the samples are passed
  double length_m_ = 0.0;
  double start_s_ = 0.0;
};

}  // namespace maplet::sim
