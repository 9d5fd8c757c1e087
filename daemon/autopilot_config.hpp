// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/base/field.hpp"

namespace maplet::daemon {

/// The pose as a record of fixed layout for an autopilot's bridge (docs/output.md). Section
/// [autopilot]; output_frame says in which axes.
struct AutopilotConfig {
  std::string destination;
  double rate_hz = 30.0;

  [[nodiscard]] bool used() const noexcept { return !destination.empty(); }

  static constexpr Field<AutopilotConfig> kFields[] = {
      {"destination", &AutopilotConfig::destination, 0, 0,
       "Where pose records go: udp:ADDRESS:PORT, udp:[ADDRESS]:PORT or unix:PATH (a datagram "
       "socket); empty = nowhere"},
      {"rate_hz", &AutopilotConfig::rate_hz, 0.1, 1000.0, "Records a second, at most"},
  };
};

}  // namespace maplet::daemon
