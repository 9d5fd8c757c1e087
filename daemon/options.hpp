// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/memory_parts.hpp"

namespace maplet::daemon {

/// What the command line of mapletd says.
struct Options {
  enum class Action : std::uint8_t {
    kRun,
    kCheckConfig,
    kPrintConfig,
    kPrintMemory,
    kPrintUnitLimits,
  };
  enum class Pace : std::uint8_t { kFast, kRecorded };

  Action action = Action::kRun;
  std::string config_file;             ///< empty: defaults
  std::vector<std::string> overrides;  ///< key=value
  std::string source;                  ///< overrides input.source
  std::string state;                   ///< folder of the journal; empty: none
  std::string out;                     ///< empty: the service
  Pace pace = Pace::kFast;
  std::uint16_t agent = 0;
  bool dds = true;
  bool agent_given = false;
  bool state_given = false;  ///< not only by $STATE_DIRECTORY

  [[nodiscard]] MemoryParts parts() const noexcept { return {dds, !state.empty()}; }
};

/// Parses the command line. Prints help or the usage error itself.
/// @return -1 to go on, else the exit code: 0 after --help, 2 for wrong usage
[[nodiscard]] int parse_options(int argc, char** argv, Options& options);

}  // namespace maplet::daemon
