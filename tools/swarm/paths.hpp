// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "core/geometry/se3.hpp"
#include "drivers/sim/random.hpp"

namespace maplet::swarm {

/// Where agents go. The worlds grow with their number, so that they meet as often.
///
///   streets  a square of crossings 12 m apart; at each one another street
///   tunnel   crossings in a line: there and back
///   hall     an open floor; straight to one place after another
///
/// Units and frames   metres, world; x along the way, z up.
class Paths {
 public:
  /// @throw std::invalid_argument: no such world
  Paths(const std::string& world, int agents, double speed_mps, std::uint64_t seed);

  /// Moves all on to `time_s`; never back.
  void advance(double time_s);
  [[nodiscard]] Se3 pose(int agent) const;
  [[nodiscard]] Eigen::Vector2d place(int agent) const { return walkers_[agent].at; }
  /// That `agent` went until now.
  [[nodiscard]] double way_m(int agent) const { return walkers_[agent].way_m; }

 private:
  struct Walker {
    Eigen::Vector2d at, from, target;
    double yaw = 0.0;
    double way_m = 0.0;
    sim::Random random;
  };
  [[nodiscard]] Eigen::Vector2d next_target(Walker& walker) const;
  [[nodiscard]] Eigen::Vector2d somewhere(sim::Random& random) const;

  bool hall_ = false;
  int across_ = 0;  ///< crossings
  int along_ = 0;
  double speed_mps_;
  double time_s_ = 0.0;
  std::vector<Walker> walkers_;
};

}  // namespace maplet::swarm
