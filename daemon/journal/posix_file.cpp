// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/journal/posix_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

namespace maplet::journal {

PosixFile::~PosixFile() {
  if (fd_ >= 0) close(fd_);
}

int PosixFile::open(const std::string& path, bool write) noexcept {
  // A pipe of that name must not hold anybody up.
  const int how = O_CLOEXEC | O_NONBLOCK | O_NOCTTY | (write ? O_RDWR | O_CREAT : O_RDONLY);
  fd_ = ::open(path.c_str(), how, 0640);
  if (fd_ < 0) return errno;
  path_ = path;
  struct stat state {};
  if (fstat(fd_, &state) == 0 && S_ISREG(state.st_mode)) return 0;
  close(std::exchange(fd_, -1));
  return S_ISDIR(state.st_mode) ? EISDIR : ESPIPE;
}

bool PosixFile::claim() noexcept {
  return flock(fd_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK;
}

bool is_claimed(const std::string& path) noexcept {
  PosixFile file;
  return file.open(path, false) == 0 && !file.claim();
}

int PosixFile::reserve(std::uint64_t bytes) noexcept {
  if (size() >= bytes) return 0;
  if (fallocate(fd_, 0, 0, static_cast<off_t>(bytes)) == 0) return flush() ? 0 : error_;
  if (errno != EOPNOTSUPP && errno != ENOSYS) return errno;
  if (ftruncate(fd_, static_cast<off_t>(bytes)) != 0) return errno;
  return flush() ? 0 : error_;
}

std::size_t PosixFile::read(std::uint64_t at, std::span<std::byte> out) noexcept {
  std::size_t done = 0;
  while (done < out.size()) {
    const ssize_t count =
        pread(fd_, out.data() + done, out.size() - done, static_cast<off_t>(at + done));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    done += static_cast<std::size_t>(count);
  }
  return done;
}

bool PosixFile::write(std::uint64_t at, std::span<const std::byte> bytes) noexcept {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t count =
        pwrite(fd_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(at + done));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      error_ = count < 0 ? errno : EIO;
      return false;
    }
    done += static_cast<std::size_t>(count);
  }
  return true;
}

bool PosixFile::flush() noexcept {
  while (fdatasync(fd_) != 0) {
    if (errno == EINTR) continue;
    error_ = errno;
    return false;
  }
  return true;
}

std::uint64_t PosixFile::size() noexcept {
  struct stat state {};
  return fstat(fd_, &state) == 0 ? static_cast<std::uint64_t>(state.st_size) : 0;
}

BlockFile::Place PosixFile::place() noexcept {
  struct stat ours {};
  struct stat named {};
  if (fstat(fd_, &ours) != 0) return Place::kThere;  // a disk in trouble says nothing of names
  if (ours.st_nlink == 0) return Place::kRemoved;
  if (stat(path_.c_str(), &named) != 0)
    return errno == ENOENT || errno == ENOTDIR ? Place::kElsewhere : Place::kThere;
  const bool same = ours.st_dev == named.st_dev && ours.st_ino == named.st_ino;
  return same ? Place::kThere : Place::kElsewhere;
}

bool flush_folder(const std::string& folder) noexcept {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return false;
  const bool good = fsync(fd) == 0;
  close(fd);
  return good;
}

}  // namespace maplet::journal
