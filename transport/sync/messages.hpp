// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/base/static_vector.hpp"
#include "core/maplet/maplet.hpp"
#include "transport/exchange/byte_io.hpp"
#include "transport/exchange/ledger.hpp"

namespace maplet {

// Bodies of the entries that are no records. read_*() return nothing when the bytes make no sense.

/// What an agent holds, in a word: equal words, equal records.
struct Beacon {
  std::uint32_t word = 0;
  bool brief = false;          ///< nothing more is said
  bool same_answered = false;  ///< everybody whom the sender hears says the same word
  std::uint32_t records = 0;   ///< that it holds
  Stamp clock{};               ///< its record clock, whole microseconds, 53 bits of them

  /// When the sender last heard whom, for the difference of their clocks.
  struct Echo {
    std::uint16_t agent = 0;
    std::uint32_t clock_us = 0;  ///< the low 32 bits of what that one's beacon said
    std::uint32_t held_us = 0;   ///< how long ago that came
  };
  StaticVector<Echo, 4> echoes;
};
void write(ByteWriter& out, const Beacon& beacon) noexcept;
[[nodiscard]] std::optional<Beacon> read_beacon(std::span<const std::byte> body) noexcept;

/// Part of a maplet, in pieces of kPieceBytes.
inline constexpr std::size_t kPieceBytes = 200;
inline constexpr std::size_t kMaxPieces = (kMaxMapletBytes + kPieceBytes - 1) / kPieceBytes;

/// "I hold this maplet".
struct MapletOffer {
  MapletKey key;
  std::uint32_t bytes = 0;
  std::uint8_t saliency = 0;  ///< of 255
};
void write(ByteWriter& out, const MapletOffer& offer) noexcept;
[[nodiscard]] std::optional<MapletOffer> read_offer(std::span<const std::byte> body) noexcept;

/// "Agent `holder`, send me these pieces": runs of piece numbers, none = all.
struct MapletRequest {
  std::uint16_t holder = 0;
  MapletKey key;
  StaticVector<SeqRange, 8> pieces;
};
void write(ByteWriter& out, const MapletRequest& request) noexcept;
[[nodiscard]] std::optional<MapletRequest> read_maplet_request(
    std::span<const std::byte> body) noexcept;

/// Whole pieces of a maplet from `first` on; only its last piece is shorter.
struct MapletChunk {
  MapletKey key;
  std::uint32_t bytes = 0;  ///< of the whole maplet
  std::uint32_t first = 0;
  std::span<const std::byte> data;
};
inline constexpr std::size_t kChunkHeadBytes = 18;  ///< at most
void write(ByteWriter& out, const MapletChunk& chunk) noexcept;
[[nodiscard]] std::optional<MapletChunk> read_chunk(std::span<const std::byte> body) noexcept;

}  // namespace maplet
