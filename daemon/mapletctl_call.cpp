// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/mapletctl_call.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>

extern char** environ;

namespace maplet::daemon {

namespace {

std::string find_mapletctl() {
  std::error_code error;
  const auto beside =
      std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / "mapletctl";
  return !error && std::filesystem::exists(beside, error) ? beside.string() : "mapletctl";
}

/// Before the program: what runs it where this processor is emulated (tests under qemu-user); else
/// nothing.
std::vector<std::string> emulator() {
  std::vector<std::string> words;
  if (const char* said = std::getenv("MAPLET_EMULATOR")) {
    std::istringstream in{said};
    for (std::string word; in >> word;) words.push_back(word);
  }
  return words;
}

}  // namespace

std::string call_mapletctl(const std::vector<std::string>& arguments) {
  std::vector<std::string> words = emulator();
  words.push_back(find_mapletctl());
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  // What it has to say on success is not the daemon's output.
  posix_spawn_file_actions_t quiet;
  posix_spawn_file_actions_init(&quiet);
  posix_spawn_file_actions_addopen(&quiet, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int error = posix_spawnp(&child, argv[0], &quiet, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&quiet);
  if (error != 0) {
    return fmt::format("{} did not start ({}); install it beside mapletd", words[0],
                       std::strerror(error));
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) return "mapletctl was lost";
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
  return fmt::format("mapletctl {} did not succeed", fmt::join(arguments, " "));
}

}  // namespace maplet::daemon
