// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include "core/agent/agent.hpp"
#include "daemon/radio_link.hpp"
#include "daemon/state_directory.hpp"

namespace maplet::daemon {

/// What a start found of earlier runs.
struct Resumed {
  std::size_t maplets = 0;
  std::size_t records = 0;
  std::size_t parts = 0;
  std::size_t imported = 0;  ///< missions
  Duration took{};
};

/// Puts what the state directory holds into the agent and the exchange, as it was: own maplets and
/// records of this life, everything else as another agent's. Nothing of it is news.
///
/// Memory   allocates; before READY. Time O(bytes of the store).
/// @param radio  not started yet; nullptr: none
[[nodiscard]] Resumed resume(StateDirectory& state, Agent& agent, RadioLink* radio,
                             std::size_t own_maplets);

/// One line for a person.
[[nodiscard]] std::string to_line(const Resumed& resumed);

}  // namespace maplet::daemon
