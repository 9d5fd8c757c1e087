// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace maplet::journal {

/// A file as the store uses it: bytes at places, and a moment after which they are safe.
///
/// Threads  one caller.
class BlockFile {
 public:
  /// Whether a later start will find what is written.
  enum class Place : std::uint8_t {
    kThere,
    kElsewhere,  ///< moved, or another file has its name: it is kept where it is now
    kRemoved,    ///< for good
  };

  virtual ~BlockFile() = default;

  /// @return how many bytes there are at `at`, at most out.size(); fewer at the end, or where the
  ///   device does not give them
  [[nodiscard]] virtual std::size_t read(std::uint64_t at, std::span<std::byte> out) noexcept = 0;
  /// @return whether all was taken; safe only after flush()
  [[nodiscard]] virtual bool write(std::uint64_t at, std::span<const std::byte> bytes) noexcept = 0;
  /// @return whether everything written before survives a power cut now
  [[nodiscard]] virtual bool flush() noexcept = 0;
  [[nodiscard]] virtual std::uint64_t size() noexcept = 0;
  [[nodiscard]] virtual Place place() noexcept { return Place::kThere; }
  /// errno of the last write or flush that failed.
  [[nodiscard]] virtual int error() const noexcept { return 0; }
};

}  // namespace maplet::journal
