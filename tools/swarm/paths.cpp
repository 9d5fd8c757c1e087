// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/swarm/paths.hpp"

#include <cmath>
#include <stdexcept>

namespace maplet::swarm {

namespace {

constexpr double kStreet_m = 12.0;

}  // namespace

Paths::Paths(const std::string& world, int agents, double speed_mps, std::uint64_t seed)
    : hall_{world == "hall"}, speed_mps_{speed_mps} {
  const int side = 1 + static_cast<int>(std::ceil(std::sqrt(2.0 * agents)));
  if (world == "streets" || world == "hall") {
    across_ = along_ = side;
  } else if (world == "tunnel") {
    across_ = 1;
    along_ = 1 + 2 * agents;
  } else {
    throw std::invalid_argument{"world '" + world + "': there are streets, tunnel, hall"};
  }
  for (int i = 0; i < agents; ++i) {
    Walker walker{{}, {}, {}, 0.0, 0.0, sim::Random{seed, 1000U + static_cast<unsigned>(i)}};
    walker.at = walker.from = somewhere(walker.random);
    walker.target = next_target(walker);
    walkers_.push_back(walker);
  }
}

Eigen::Vector2d Paths::somewhere(sim::Random& random) const {
  if (hall_) {
    const double x = random.uniform(0.0, kStreet_m * across_);
    return {x, random.uniform(0.0, kStreet_m * along_)};
  }
  const int i = random.index(across_);
  return kStreet_m * Eigen::Vector2d{i, random.index(along_)};
}

// A crossing beside this one, and not the one it came from where there is another.
Eigen::Vector2d Paths::next_target(Walker& walker) const {
  if (hall_) return somewhere(walker.random);
  std::vector<Eigen::Vector2d> ways;
  for (const auto& step : {Eigen::Vector2d{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
    const Eigen::Vector2d to = walker.at + kStreet_m * step;
    const bool inside = to.minCoeff() > -1.0 && to.x() < kStreet_m * across_ - 1.0 &&
                        to.y() < kStreet_m * along_ - 1.0;
    if (inside && (to - walker.from).norm() > 1.0) ways.push_back(to);
  }
  if (ways.empty()) return walker.from;
  return ways[static_cast<std::size_t>(walker.random.index(static_cast<int>(ways.size())))];
}

void Paths::advance(double time_s) {
  const double step_m = speed_mps_ * (time_s - time_s_);
  time_s_ = time_s;
  for (Walker& walker : walkers_) {
    double left_m = step_m;
    walker.way_m += step_m;
    while (left_m > 0.0) {
      const Eigen::Vector2d to = walker.target - walker.at;
      if (to.norm() > 1e-9) walker.yaw = std::atan2(to.y(), to.x());
      if (to.norm() > left_m) {
        walker.at += left_m * to.normalized();
        break;
      }
      left_m -= to.norm();
      walker.at = walker.target;
      walker.target = next_target(walker);
      walker.from = walker.at;
      if ((walker.target - walker.at).norm() < 1e-9) break;  // a world of one place
    }
  }
}

Se3 Paths::pose(int agent) const {
  const Walker& walker = walkers_[agent];
  return {Eigen::Quaterniond{Eigen::AngleAxisd{walker.yaw, Eigen::Vector3d::UnitZ()}},
          {walker.at.x(), walker.at.y(), 0.0}};
}

}  // namespace maplet::swarm
