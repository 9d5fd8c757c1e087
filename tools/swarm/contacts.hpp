// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "drivers/sim/random.hpp"
#include "tools/swarm/paths.hpp"
#include "tools/swarm/swarm_config.hpp"

namespace maplet::swarm {

/// Who hears whom, second by second.
///
///   random   two by two, wherever they are: meet_every_s, meet_for_s
///   near     everybody within range_m
///   all      everybody
///   FILE     a line a meeting: from_s to_s agent agent; # begins a comment
class Contacts {
 public:
  /// @throw std::invalid_argument: no such plan; or FILE cannot be read, or its line N says why not
  explicit Contacts(const SwarmConfig& config);

  void advance(double time_s, const Paths& paths);
  /// Agents 0 .. agents - 1 that hear `agent`, and that it hears.
  [[nodiscard]] const std::vector<int>& of(int agent) const { return heard_by_[agent]; }

 private:
  enum class Plan : std::uint8_t { kRandom, kNear, kAll, kFile };
  struct Meeting {
    double from_s, to_s;
    int a, b;
  };

  void read(const std::string& path);
  void meet_at_random(double time_s);

  SwarmConfig config_;
  Plan plan_ = Plan::kRandom;
  sim::Random random_;
  std::vector<std::vector<int>> heard_by_;
  std::vector<Meeting> meetings_;  ///< of FILE; at random: those under way
  std::vector<bool> busy_;
};

}  // namespace maplet::swarm
