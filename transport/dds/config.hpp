// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/base/field.hpp"

namespace maplet {

/// The local domain: programs on the robot and `mapletctl watch`.
struct DdsConfig {
  int domain = 0;
  std::string interface = "lo";    ///< not a key: the local domain never leaves the robot
  std::vector<std::string> peers;  ///< addresses to look for others at; lo has its own
  int delta_pose_history = 256;
  int maplet_history = 32;

  static constexpr Field<DdsConfig> kFields[] = {
      {"domain", &DdsConfig::domain, 0, 230, "DDS domain of the programs on this robot"},
      {"delta_pose_history", &DdsConfig::delta_pose_history, 1, 16384,
       "Delta-poses of each agent that a late subscriber still gets"},
      {"maplet_history", &DdsConfig::maplet_history, 1, 256,
       "Maplets of each agent that a late subscriber still gets"},
  };
};

inline constexpr std::string_view kDeltaPoseTopic = "maplet/delta_pose";
inline constexpr std::string_view kMapletTopic = "maplet/maplet";
inline constexpr std::string_view kStatusTopic = "maplet/status";
inline constexpr std::string_view kRangeTopic = "maplet/range";

// Participant indices, the contracts' "follows --agent": a daemon takes the first free one from its
// agent id on, a watcher one behind all daemons'. Unicast discovery asks all of them.
inline constexpr int kDaemonIndices = 32;
inline constexpr int kWatcherIndices = 32;
inline constexpr int kParticipantIndices = kDaemonIndices + kWatcherIndices;
static_assert(kParticipantIndices <= 120, "ports of the next domain begin there");

/// Text for between two tags.
[[nodiscard]] std::string xml_escaped(std::string_view text);
/// <Threads> with bounded stacks.
[[nodiscard]] std::string cyclone_threads_xml();

/// Cyclone's configuration. docs/memory.md says what its bounds add up to.
[[nodiscard]] std::string cyclone_xml(const DdsConfig& config, int participant_index,
                                      bool multicast);

}  // namespace maplet
