// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

#include "tools/mapletctl/command_line.hpp"

namespace maplet::ctl {

/// A command that did not work out: `message` is the one line for standard error (what, where, what
/// to do); exit code 1, or 2 for usage and configuration.
class Failure : public std::runtime_error {
 public:
  explicit Failure(const std::string& message, int code = 1)
      : std::runtime_error{message}, exit_code{code} {}
  int exit_code;
};

// Each command lives in a file of its own and adds itself to the command line.
void add_check(Command app);
void add_daemon_commands(Command app);
void add_demo(Command app);
void add_diff(Command app);
void add_draw(Command app);
void add_eval(Command app);
void add_export(Command app);
void add_keys(Command app);
void add_match(Command app);
void add_mission(Command app);
void add_patches(Command app);
void add_patches_eval(Command app);
void add_range(Command app);
void add_record(Command app);
void add_recorder(Command app);
void add_register(Command app);
void add_show(Command app);
void add_simulate(Command app);
void add_solve(Command app);
void add_swarm(Command app);
void add_top(Command app);
void add_version(Command app);
void add_watch(Command app);
void add_ways(Command app);

}  // namespace maplet::ctl
