// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/expected.hpp"
#include "transport/exchange/byte_io.hpp"
#include "transport/exchange/ledger.hpp"

namespace maplet {

/// What an entry of a datagram is. Numbers are for ever; unknown ones are skipped.
enum class EntryKind : std::uint8_t {
  kDeltaPose = 1,      ///< record_codec.hpp
  kRange = 2,          ///< record_codec.hpp
  kBeacon = 3,         ///< sync/messages.hpp
  kDigest = 9,         ///< digest.hpp; 4 was an earlier one
  kRequest = 5,        ///< sync/messages.hpp
  kMapletOffer = 6,    ///< sync/messages.hpp
  kMapletRequest = 7,  ///< sync/messages.hpp
  kMapletChunk = 8,    ///< sync/messages.hpp
};

/// What stands before the entries.
struct DatagramHead {
  Life sender;
  std::uint16_t count = 0;  ///< of the sender's datagrams, wraps
};

/// A datagram of ours: head, entries, CRC-32C.
///
///   octet    4 bits 0xA, 4 bits version (1)
///   u16 u32  sender's agent and epoch
///   u16      count
///   entries: kind (octet), length (varint), body
///   u32      CRC-32C of everything before
///
/// Little-endian. A newer version of an entry is a new kind; a newer version of the whole is a new
/// version number, which older agents count and leave alone. Versions 2 to 4 are those of
/// security/frame.hpp.
inline constexpr std::uint8_t kDatagramVersion = 1;
inline constexpr std::size_t kDatagramHeadBytes = 9;
inline constexpr std::size_t kDatagramCrcBytes = 4;
inline constexpr std::size_t kMaxDatagramBytes = 1200;
inline constexpr std::size_t kEntryHeadBytes = 3;  ///< at most

/// Fills a datagram.
///
/// Memory   a view of the caller's buffer.
class DatagramWriter {
 public:
  /// @param out  at least kDatagramHeadBytes + kDatagramCrcBytes
  DatagramWriter(std::span<std::byte> out, const DatagramHead& head) noexcept;

  /// Adds an entry, if it fits. @return whether it did
  bool add(EntryKind kind, std::span<const std::byte> body) noexcept;
  /// Room for one more entry's body.
  [[nodiscard]] std::size_t room() const noexcept;
  [[nodiscard]] bool empty() const noexcept { return entries_ == 0; }
  [[nodiscard]] std::size_t size() const noexcept { return writer_.size() + kDatagramCrcBytes; }
  /// Closes it. @return the whole datagram
  [[nodiscard]] std::span<const std::byte> finish() noexcept;

 private:
  std::span<std::byte> out_;
  ByteWriter writer_;  ///< everything but the CRC
  int entries_ = 0;
};

/// Why a datagram was not taken.
enum class DatagramFault : std::uint8_t { kNone, kDamaged, kFuture };

/// Reads a datagram, or anything at all.
class DatagramReader {
 public:
  /// Checks length, version and CRC. Entries of a faulty datagram are none.
  explicit DatagramReader(std::span<const std::byte> bytes) noexcept;

  [[nodiscard]] DatagramFault fault() const noexcept { return fault_; }
  [[nodiscard]] const DatagramHead& head() const noexcept { return head_; }

  struct Entry {
    EntryKind kind;
    std::span<const std::byte> body;
  };
  /// @return false at the end; broken() says whether that came too early
  [[nodiscard]] bool next(Entry& entry) noexcept;
  [[nodiscard]] bool broken() const noexcept { return broken_; }

 private:
  DatagramHead head_;
  DatagramFault fault_ = DatagramFault::kDamaged;
  ByteReader in_;
  bool broken_ = false;
};

}  // namespace maplet
