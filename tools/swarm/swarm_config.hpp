// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace maplet::swarm {

/// A mission of many agents, as far as what they say to each other goes.
struct SwarmConfig {
  int agents = 10;
  std::uint64_t seed = 1;
  double minutes = 60.0;               ///< in which maplets are made
  double most_minutes = 60.0;          ///< after them, until all hold the same
  double maplet_every_s = 60.0;        ///< each agent's
  std::string world = "streets";       ///< paths.hpp
  double speed_mps = 0.1;              ///< of an agent
  std::string contacts = "random";     ///< contacts.hpp
  double meet_every_s = 60.0;          ///< random: from one agent's meeting to its next, on average
  double meet_for_s = 20.0;            ///< random: a meeting
  double range_m = 15.0;               ///< near: how far a radio reaches
  std::string profile = "wifi";        ///< transport/sync/sync_config.hpp
  double budget_bytes_per_s = 4000.0;  ///< of each agent, IP bytes
  double loss = 0.02;                  ///< of datagrams, each receiver by itself
  double lease_s = 0.0;                ///< those who are gone are taken for present so long
  int solve = 5;                       ///< agents that compute their skeletons, drawn by seed
};

}  // namespace maplet::swarm
