// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tests/support/process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "tests/support/patience.hpp"

namespace maplet::test {

namespace {

std::filesystem::path fresh_file(const char* kind) {
  static std::atomic<int> count{0};
  return std::filesystem::temp_directory_path() /
         ("maplet_process_" + std::to_string(getpid()) + "_" + std::to_string(count++) + kind);
}

std::string read_all(const std::filesystem::path& path) {
  std::ifstream file{path};
  return {std::istreambuf_iterator<char>{file}, {}};
}

void redirect(const std::filesystem::path& path, int to) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  ::dup2(fd, to);
}

}  // namespace

Process::Process(std::vector<std::string> command)
    : out_{fresh_file(".out")}, err_{fresh_file(".err")}, start_{std::chrono::steady_clock::now()} {
  if (command.front().find('/') == std::string::npos) {
    command.front() = (bin_dir() / command.front()).string();
  }
  // Programs of another processor: the words before them, "qemu-aarch64-static -L sysroot".
  if (const char* emulator = std::getenv("MAPLET_EMULATOR");
      emulator != nullptr && command.front().starts_with(bin_dir().string())) {
    std::istringstream words{emulator};
    command.insert(command.begin(), std::istream_iterator<std::string>{words}, {});
  }
  std::vector<char*> argv;
  for (std::string& word : command) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_ = fork();
  if (pid_ < 0) throw std::runtime_error{"fork failed"};
  if (pid_ == 0) {
    redirect("/dev/null", STDIN_FILENO);
    redirect(out_, STDOUT_FILENO);
    redirect(err_, STDERR_FILENO);
    execv(argv[0], argv.data());
    _exit(127);
  }
}

Process::~Process() {
  if (running()) {
    signal(SIGKILL);
    waitpid(pid_, &status_, 0);
  }
  std::error_code ignored;
  std::filesystem::remove(out_, ignored);
  std::filesystem::remove(err_, ignored);
}

void Process::signal(int number) const {
  if (!reaped_) kill(pid_, number);
}

bool Process::running() {
  if (!reaped_ && waitpid(pid_, &status_, WNOHANG) == pid_) reaped_ = true;
  return !reaped_;
}

Finished Process::wait(std::chrono::seconds limit) {
  const auto end = std::chrono::steady_clock::now() + limit * patience();
  bool killed = false;
  while (running()) {
    if (std::chrono::steady_clock::now() > end) {
      signal(SIGKILL);
      killed = true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  }
  Finished finished;
  finished.took = std::chrono::duration_cast<std::chrono::milliseconds>(
      std::chrono::steady_clock::now() - start_);
  finished.exit_code = WIFEXITED(status_) ? WEXITSTATUS(status_) : 128 + WTERMSIG(status_);
  if (killed) finished.exit_code = -1;
  finished.out = out();
  finished.err = err();
  return finished;
}

std::string Process::out() const { return read_all(out_); }
std::string Process::err() const { return read_all(err_); }

}  // namespace maplet::test
