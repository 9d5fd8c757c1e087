// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/clear_mission.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <vector>

#include "daemon/journal/posix_file.hpp"
#include "daemon/state_directory.hpp"

namespace maplet::daemon {

namespace fs = std::filesystem;

namespace {

constexpr const char* kClearMark = "clear-at-start";

/// The mark last: a power cut in between, and the next start goes on removing.
std::vector<fs::path> files_of(const std::string& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator{folder, error}) {
    const fs::path name = entry.path().filename();
    if (name == kMissionFile || name.extension() == kImportSuffix) files.push_back(entry.path());
  }
  if (clear_is_asked(folder)) files.push_back(fs::path{folder} / kClearMark);
  return files;
}

}  // namespace

bool clear_is_asked(const std::string& folder) {
  std::error_code error;
  return fs::exists(fs::symlink_status(folder + "/" + kClearMark, error));
}

std::string remove_mission(const std::string& folder) {
  for (const fs::path& file : files_of(folder)) {
    if (file.filename() == kClearMark) (void)journal::flush_folder(folder);
    std::error_code error;
    fs::remove(file, error);
    if (error) return fmt::format("{}: {}", file.string(), error.message());
  }
  (void)journal::flush_folder(folder);
  return {};
}

tl::expected<Cleared, std::string> clear_mission(const std::string& folder) {
  if (files_of(folder).empty()) return tl::unexpected{folder + ": holds no mission"};
  // The mark first: whatever happens next, the mission is over.
  const std::string mark = folder + "/" + kClearMark;
  const int made =
      open(mark.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0640);
  if (made < 0) {
    return tl::unexpected{fmt::format("{}: cannot be cleared: {}", folder, std::strerror(errno))};
  }
  close(made);
  (void)journal::flush_folder(folder);
  const std::string lock = folder + "/" + kLockFile;
  const int fd = open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0640);
  const bool ours = fd >= 0 && flock(fd, LOCK_EX | LOCK_NB) == 0 &&
                    !journal::is_claimed(folder + "/" + kMissionFile);
  const std::string left = ours ? remove_mission(folder) : "";
  if (fd >= 0) close(fd);
  if (!left.empty()) return tl::unexpected{left + "; the next start of mapletd tries it again"};
  return ours ? Cleared::kNow : Cleared::kAtNextStart;
}

}  // namespace maplet::daemon
