// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/output_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace maplet::daemon {

OutputFile::~OutputFile() { close(); }

bool OutputFile::open(const char* path) noexcept {
  close();
  error_ = 0;
  fd_ = ::open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd_ < 0) error_ = errno;
  return fd_ >= 0;
}

void OutputFile::append(std::string_view text) noexcept {
  while (!text.empty() && fd_ >= 0 && error_ == 0) {
    const std::size_t fits = std::min(text.size(), buffer_.size() - used_);
    std::memcpy(buffer_.data() + used_, text.data(), fits);
    used_ += fits;
    text.remove_prefix(fits);
    if (used_ == buffer_.size()) flush();
  }
}

void OutputFile::append(std::span<const std::byte> bytes) noexcept {
  append(std::string_view{reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

bool OutputFile::close() noexcept {
  if (fd_ < 0) return error_ == 0;
  flush();
  if (::close(fd_) != 0 && error_ == 0) error_ = errno;
  fd_ = -1;
  return error_ == 0;
}

void OutputFile::flush() noexcept {
  const char* next = buffer_.data();
  while (used_ > 0 && error_ == 0) {
    const ssize_t written = ::write(fd_, next, used_);
    if (written < 0) {
      if (errno != EINTR) error_ = errno;
      continue;
    }
    next += written;
    used_ -= static_cast<std::size_t>(written);
  }
  used_ = 0;
}

}  // namespace maplet::daemon
