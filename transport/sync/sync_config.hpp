// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include "core/base/clock.hpp"
#include "core/base/field.hpp"

namespace maplet {

/// What is kept for the others. Section [exchange]. Sizes the arena.
struct SyncConfig {
  int max_lives = 256;
  int records_kept = 6144;
  int ranges_kept = 1024;
  int maplets_kept = 512;
  std::string maplets = "all";
  Duration idle_interval = std::chrono::seconds{45};
  Duration linger = std::chrono::seconds{10};
  std::size_t expected_maplet_bytes = 4096;  ///< no key: what the images' size makes of them

  static constexpr Field<SyncConfig> kFields[] = {
      {"max_lives", &SyncConfig::max_lives, 2, 1024,
       "Agents, each restart without a journal anew, whose records are told apart"},
      {"records_kept", &SyncConfig::records_kept, 16, 1e6,
       "Delta-poses and closures of all agents kept to pass on; beyond it the oldest goes"},
      {"ranges_kept", &SyncConfig::ranges_kept, 16, 1e6,
       "Ranges of all agents kept to pass on; beyond it the oldest goes"},
      {"maplets_kept", &SyncConfig::maplets_kept, 1, 65536,
       "Maplets of all agents kept to give away; beyond it the oldest goes"},
      {"maplets", &SyncConfig::maplets, 0, 0,
       "Which maplets of others to ask for: all as the budget allows, those near our own, or none",
       "all|near|none"},
      {"idle_interval_s", &SyncConfig::idle_interval, 1, 600,
       "Between two signs of life while nothing happens"},
      {"linger_s", &SyncConfig::linger, 0, 3600,
       "How long a finite run goes on exchanging at its end, while others are heard"},
  };
};

/// What kind of link the node speaks on.
struct LinkProfile {
  std::size_t datagram_bytes = 1000;  ///< at most
  bool mixed = false;  ///< small things share datagrams; else each kind of traffic has its own
  Duration quick =
      std::chrono::milliseconds{800};  ///< between two digests while something is unconfirmed
  Duration holdoff =
      std::chrono::milliseconds{700};  ///< nothing is sent twice within: a round trip and its queue
  Duration again = std::chrono::milliseconds{900};  ///< news are said anew, if not confirmed
  std::size_t assemblies = 4;
};

/// At least 64 kbit/s: a topic for each kind of traffic.
[[nodiscard]] constexpr LinkProfile wifi_profile() noexcept { return {}; }
/// At most 20 kbit/s: two topics, packed frames, patience above the queueing time.
[[nodiscard]] constexpr LinkProfile radio_profile() noexcept {
  return {480, true, std::chrono::seconds{4}, std::chrono::seconds{4}, std::chrono::seconds{6}, 1};
}

}  // namespace maplet
