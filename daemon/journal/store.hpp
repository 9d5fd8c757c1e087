// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "daemon/journal/reader.hpp"

namespace maplet::journal {

/// What is kept when the halves change: the newest.
struct Keep {
  std::size_t maplets = 512;
  std::size_t maplet_bytes = std::size_t{2} << 20;
  std::size_t records = 8192;
};

/// Appends turns; at a half's end carries what counts over to the other half.
///
/// At any moment, and after any of the writes that were not flushed was lost, torn or came out of
/// order, the file holds everything up to the last flush that came back.
///
/// Memory   views of the caller's buffers, two of kMaxTurnBytes.
/// Threads  one.
class Store {
 public:
  /// @param scratch  2 x kMaxTurnBytes
  Store(BlockFile& file, std::span<std::byte> scratch) noexcept : file_{file}, scratch_{scratch} {}

  /// Begins a mission. Nothing is written yet.
  void begin(Life life, std::uint32_t half_pages) noexcept;
  /// Goes on behind what is there. One of an older version changes halves, and so versions.
  /// @return false: the file does not take it
  [[nodiscard]] bool go_on(const Survey& survey, const Keep& keep) noexcept;

  /// Writes a turn and waits until it is safe. Changes the halves first where it has no room.
  /// @return false: the file does not take it; nothing that was safe before is lost
  [[nodiscard]] bool append(TurnBuilder& turn, const Keep& keep) noexcept;

  /// Handed to the file since the beginning, in whole pages; and of these, for a change of halves.
  [[nodiscard]] std::uint64_t bytes_written() const noexcept { return bytes_written_; }
  [[nodiscard]] std::uint64_t bytes_carried() const noexcept { return bytes_carried_; }
  [[nodiscard]] std::uint32_t generation() const noexcept { return generation_; }
  [[nodiscard]] std::uint64_t half_bytes() const noexcept {
    return std::uint64_t{half_pages_} * kPageBytes;
  }

 private:
  class Carrier;
  [[nodiscard]] bool write(std::span<std::byte> turn, bool carried,
                           const std::array<std::uint32_t, kStreams>& ends) noexcept;
  [[nodiscard]] bool change_halves(const Keep& keep,
                                   const std::array<std::uint32_t, kStreams>& ends) noexcept;
  [[nodiscard]] std::uint64_t base() const noexcept {
    return static_cast<std::uint64_t>(half_) * half_bytes();
  }

  BlockFile& file_;
  std::span<std::byte> scratch_;
  Life life_;
  std::uint32_t half_pages_ = 0;
  int half_ = 0;
  std::uint32_t generation_ = 1;
  std::uint32_t most_generation_ = 1;
  std::uint32_t number_ = 0;
  std::uint64_t at_ = 0;
  std::array<std::uint32_t, kStreams> ends_{};
  std::uint64_t bytes_written_ = 0;
  std::uint64_t bytes_carried_ = 0;
};

}  // namespace maplet::journal
