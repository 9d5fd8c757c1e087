// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <stdexcept>
#include <string>

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
void add_check(CLI::App& app);
void add_daemon_commands(CLI::App& app);
void add_draw(CLI::App& app);
void add_eval(CLI::App& app);
void add_export(CLI::App& app);
void add_match(CLI::App& app);
void add_patches(CLI::App& app);
void add_patches_eval(CLI::App& app);
void add_register(CLI::App& app);
void add_show(CLI::App& app);
void add_simulate(CLI::App& app);
void add_solve(CLI::App& app);
void add_top(CLI::App& app);
void add_version(CLI::App& app);
void add_watch(CLI::App& app);

}  // namespace maplet::ctl
