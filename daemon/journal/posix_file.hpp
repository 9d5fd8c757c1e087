// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "daemon/journal/block_file.hpp"

namespace maplet::journal {

/// A file of the system's.
///
/// Threads  one caller; errno of the last failure from error().
class PosixFile final : public BlockFile {
 public:
  PosixFile() noexcept = default;
  ~PosixFile() override;
  PosixFile(const PosixFile&) = delete;
  PosixFile& operator=(const PosixFile&) = delete;

  /// @param write  made when it is not there
  /// @return 0, or errno; EISDIR, ESPIPE: it is no file
  [[nodiscard]] int open(const std::string& path, bool write) noexcept;
  /// Takes the room now, so that it is not missing later.
  [[nodiscard]] int reserve(std::uint64_t bytes) noexcept;
  /// Keeps other processes from claiming it, whatever name they found it by, until it is closed.
  /// @return false: another one has
  [[nodiscard]] bool claim() noexcept;
  [[nodiscard]] bool is_open() const noexcept { return fd_ >= 0; }
  [[nodiscard]] int error() const noexcept override { return error_; }

  [[nodiscard]] std::size_t read(std::uint64_t at, std::span<std::byte> out) noexcept override;
  [[nodiscard]] bool write(std::uint64_t at, std::span<const std::byte> bytes) noexcept override;
  [[nodiscard]] bool flush() noexcept override;
  [[nodiscard]] std::uint64_t size() noexcept override;
  [[nodiscard]] Place place() noexcept override;

 private:
  std::string path_;
  int fd_ = -1;
  int error_ = 0;
};

/// Another process has claimed the file of that name.
[[nodiscard]] bool is_claimed(const std::string& path) noexcept;

/// Makes what was done in a folder (names made, renamed, removed) survive a power cut.
bool flush_folder(const std::string& folder) noexcept;

}  // namespace maplet::journal
