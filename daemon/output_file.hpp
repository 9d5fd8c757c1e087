// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

namespace maplet::daemon {

/// A file that is written front to back without allocating, so that the frame path may use it.
///
/// The first error (disk full, folder removed) is kept and everything after it dropped.
/// Memory  one 64 KiB buffer inside the object. Threads  one.
class OutputFile {
 public:
  OutputFile() = default;
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Creates or truncates. @return false: see error()
  bool open(const char* path) noexcept;
  void append(std::string_view text) noexcept;
  void append(std::span<const std::byte> bytes) noexcept;
  /// Writes what is buffered. @return false when anything since open() failed
  bool close() noexcept;

  /// errno of the first failure, 0 when all is well.
  [[nodiscard]] int error() const noexcept { return error_; }

 private:
  void flush() noexcept;

  int fd_ = -1;
  int error_ = 0;
  std::size_t used_ = 0;
  std::array<char, 65536> buffer_;
};

}  // namespace maplet::daemon
