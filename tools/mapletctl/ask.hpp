// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {

/// Which daemon to ask.
struct Daemon {
  std::string socket;  ///< a path; empty: by agent
  int agent = -1;      ///< -1: the only one there is
};

/// Adds --agent and --socket.
void add_daemon_options(Command command, const std::shared_ptr<Daemon>& daemon);

/// Asks over the daemon's Unix socket. Throws Failure with the remedy.
[[nodiscard]] nlohmann::ordered_json ask(const Daemon& daemon,
                                         const nlohmann::ordered_json& question);

}  // namespace maplet::ctl
