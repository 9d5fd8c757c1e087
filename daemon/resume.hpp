// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "core/agent/agent.hpp"
#include "daemon/flight_log.hpp"
#include "daemon/own_records.hpp"
#include "daemon/radio_link.hpp"
#include "daemon/state_directory.hpp"

namespace maplet::daemon {

/// What a start found of earlier runs.
struct Resumed {
  std::size_t maplets = 0;
  std::size_t records = 0;
  std::size_t parts = 0;
  std::size_t imported = 0;  ///< missions
  Duration took{};           ///< reading the store included
};

/// Puts what the state directory holds into the agent and the exchange, as it was: own maplets and
/// records of this life, everything else as another agent's. Nothing of it is news.
///
/// Memory   allocates; before READY. Time O(bytes of the store).
/// @param radio   not started yet; nullptr: none
/// @param flight  records it, if it records
[[nodiscard]] Resumed resume(StateDirectory& state, Agent& agent, RadioLink* radio,
                             FlightLog& flight, std::size_t own_maplets);

/// The same from a flight recorder's file. @return the first maplet of the part that begins;
/// nothing when what ran did not resume
[[nodiscard]] std::optional<std::uint32_t> resume_again(FlightLog& flight, Agent& agent,
                                                        OwnRecords& records);

/// One line for a person.
[[nodiscard]] std::string to_line(const Resumed& resumed);

}  // namespace maplet::daemon
