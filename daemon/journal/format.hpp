// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "transport/exchange/ledger.hpp"

/// The bytes of a mission's store (docs/journal.md).
///
/// The file has two halves of equal size. In a half stand turns, one behind the other, each from a
/// page's beginning on: a head, then items. A turn was written as a whole or is none.
namespace maplet::journal {

inline constexpr std::size_t kPageBytes = 4096;
inline constexpr std::size_t kHeadBytes = 64;
inline constexpr std::size_t kMaxTurnBytes = 24 * kPageBytes;  ///< head included
inline constexpr std::size_t kMaxPayloadBytes = kMaxTurnBytes - kHeadBytes;
inline constexpr std::uint16_t kVersion = 2;
/// Places without a turn between two turns that a reader looks beyond: damage may be that long.
inline constexpr std::uint64_t kLookaheadPages = 256;

/// What stands before the items of a turn, in every version at the same place:
///
///    0  u32 magic "mtrn"      4  u32 CRC-32C of octets 8..63
///    8  u16 version          10  u16 agent           12  u32 epoch
///   16  u32 generation       20  u32 number          24  u32 payload's bytes
///   28  u32 its CRC-32C      32  u32 its FNV-1a      36  u32 pages of a half
///   40  u8 carried, 3 octets 0
///   44  u32 x 4 own records up to here, by stream (since version 2)   60  u32 0
struct TurnHead {
  std::uint16_t version = kVersion;
  Life life;
  std::uint32_t generation = 0;  ///< counts the changes from one half to the other, from 1
  std::uint32_t number = 0;      ///< of the turn in its generation, from 0
  std::uint32_t payload_bytes = 0;
  std::uint32_t payload_crc = 0;
  std::uint32_t payload_fnv = 0;
  std::uint32_t half_pages = 0;
  /// Copied when the halves changed. A generation counts once it holds one that is not.
  bool carried = false;
  std::array<std::uint32_t, kStreams> ends{};

  friend bool operator==(const TurnHead&, const TurnHead&) = default;
};

/// How many pages a turn with so much payload takes.
[[nodiscard]] constexpr std::uint64_t pages_of(std::uint64_t payload_bytes) noexcept {
  return (kHeadBytes + payload_bytes + kPageBytes - 1) / kPageBytes;
}

[[nodiscard]] std::uint32_t fnv1a(std::span<const std::byte> bytes) noexcept;

/// Fills in the payload's size and checksums and writes the head.
/// @param turn  kHeadBytes, then the payload
void seal(TurnHead head, std::span<std::byte> turn) noexcept;

/// @param bytes  kHeadBytes; one flipped bit is set right
/// @param mended  counts those
/// @return nothing when there is no head
[[nodiscard]] std::optional<TurnHead> read_head(std::span<std::byte> bytes,
                                                std::uint32_t& mended) noexcept;

/// Whether the payload is what was written; one flipped bit is set right.
[[nodiscard]] bool check_payload(const TurnHead& head, std::span<std::byte> payload,
                                 std::uint32_t& mended) noexcept;

}  // namespace maplet::journal
