// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace maplet::test {

/// Where the programs under test are: MAPLET_BIN_DIR, set by ctest.
inline std::filesystem::path bin_dir() {
  const char* set = std::getenv("MAPLET_BIN_DIR");
  return set != nullptr ? set : "build/dev/bin";
}

/// What a finished process left behind.
struct Finished {
  int exit_code = -1;  ///< 128 + signal when one ended it; -1 when it had to be killed: time-out
  std::string out;
  std::string err;
  std::chrono::milliseconds took{};
};

/// A child process whose output goes into files; killed when it goes out of scope.
class Process {
 public:
  /// @param command  program and arguments; a bare name is looked for in bin_dir()
  explicit Process(std::vector<std::string> command);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void signal(int number) const;
  [[nodiscard]] bool running();
  /// Waits, at most so long; then kills it.
  Finished wait(std::chrono::seconds limit = std::chrono::seconds{60});
  /// Standard output up to now.
  [[nodiscard]] std::string out() const;
  [[nodiscard]] std::string err() const;

 private:
  pid_t pid_ = -1;
  int status_ = 0;
  bool reaped_ = false;
  std::filesystem::path out_;
  std::filesystem::path err_;
  std::chrono::steady_clock::time_point start_;
};

/// Runs a command to its end.
inline Finished run(std::vector<std::string> command,
                    std::chrono::seconds limit = std::chrono::seconds{60}) {
  return Process{std::move(command)}.wait(limit);
}

}  // namespace maplet::test
