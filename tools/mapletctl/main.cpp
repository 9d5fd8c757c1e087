// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// mapletctl: looks at, feeds and asks mapletd.
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>

#include "tools/mapletctl/command.hpp"

namespace {

/// A reader that closes its pipe has what it wanted.
bool is_pipe(int fd) {
  struct stat status {};
  return fstat(fd, &status) == 0 && (S_ISFIFO(status.st_mode) || S_ISSOCK(status.st_mode));
}

}  // namespace

int main(int argc, char** argv) {
  using namespace maplet::ctl;
  int code = 0;
  try {
    code = run_command_line(
        argc, argv, "mapletctl: looks at recordings, maplets, skeletons and a running mapletd",
        [](Command app) {
          add_daemon_commands(app);
          add_check(app);
          add_demo(app);
          add_diff(app);
          add_draw(app);
          add_eval(app);
          add_export(app);
          add_keys(app);
          add_match(app);
          add_mission(app);
          add_patches(app);
          add_patches_eval(app);
          add_range(app);
          add_record(app);
          add_recorder(app);
          add_register(app);
          add_show(app);
          add_simulate(app);
          add_solve(app);
          add_swarm(app);
          add_top(app);
          add_version(app);
          add_watch(app);
          add_ways(app);
        });
  } catch (const Failure& e) {
    fmt::print(stderr, "mapletctl: {}\n", e.what());
    return e.exit_code;
  } catch (const std::exception& e) {
    fmt::print(stderr, "mapletctl: {}\n", e.what());
    return 1;
  }
  if ((std::fflush(stdout) != 0 || std::ferror(stdout) != 0) && !is_pipe(STDOUT_FILENO)) {
    fmt::print(stderr, "mapletctl: standard output: cannot be written; make room or name a file\n");
    return 1;
  }
  return code;
}
