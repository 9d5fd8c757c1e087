// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/sync/messages.hpp"

namespace maplet {

namespace {

void write_key(ByteWriter& out, const MapletKey& key) noexcept {
  out.varint(key.agent);
  out.fixed(key.epoch, 4);
  out.varint(key.id);
}

MapletKey read_key(ByteReader& in) noexcept {
  MapletKey key;
  key.agent = static_cast<std::uint16_t>(in.varint_to(0xFFFF));
  key.epoch = static_cast<std::uint32_t>(in.fixed(4));
  key.id = static_cast<std::uint32_t>(in.varint_to(SeqSet::kSeqEnd - 1));
  return key;
}

std::uint32_t read_u32(ByteReader& in, std::uint64_t most) noexcept {
  return static_cast<std::uint32_t>(in.varint_to(most));
}

}  // namespace

void write(ByteWriter& out, const Beacon& beacon) noexcept {
  out.fixed(beacon.word, 4);
  if (beacon.brief) return;
  out.varint(std::uint64_t{beacon.records} << 1 | (beacon.same_answered ? 1U : 0U));
  out.fixed(static_cast<std::uint64_t>(beacon.clock.count() / 1000), 7);
  for (const Beacon::Echo& echo : beacon.echoes) {
    out.varint(echo.agent);
    out.fixed(echo.clock_us, 4);
    out.varint(echo.held_us);
  }
}

std::optional<Beacon> read_beacon(std::span<const std::byte> body) noexcept {
  ByteReader in{body};
  Beacon beacon;
  beacon.word = static_cast<std::uint32_t>(in.fixed(4));
  beacon.brief = in.ok() && in.left() == 0;
  if (beacon.brief) return beacon;
  const std::uint64_t second = in.varint_to(0x1FFFFFFFF);
  constexpr std::uint64_t kClockMask = (std::uint64_t{1} << 53) - 1;  // in ns it fits 63 bits
  beacon.clock = Stamp{static_cast<std::int64_t>(in.fixed(7) & kClockMask) * 1000};
  beacon.records = static_cast<std::uint32_t>(second >> 1);
  beacon.same_answered = (second & 1U) != 0;
  while (in.ok() && in.left() > 0) {
    if (full(beacon.echoes)) return {};
    Beacon::Echo echo;
    echo.agent = static_cast<std::uint16_t>(in.varint_to(0xFFFF));
    echo.clock_us = static_cast<std::uint32_t>(in.fixed(4));
    echo.held_us = read_u32(in, 0xFFFFFFFF);
    beacon.echoes.push_back(echo);
  }
  if (!in.ok()) return {};
  return beacon;
}

void write(ByteWriter& out, const MapletOffer& offer) noexcept {
  write_key(out, offer.key);
  out.varint(offer.bytes);
  out.fixed(offer.saliency, 1);
}

std::optional<MapletOffer> read_offer(std::span<const std::byte> body) noexcept {
  ByteReader in{body};
  MapletOffer offer;
  offer.key = read_key(in);
  offer.bytes = read_u32(in, kMaxMapletBytes);
  offer.saliency = static_cast<std::uint8_t>(in.fixed(1));
  if (!in.ok() || in.left() != 0) return {};
  return offer;
}

void write(ByteWriter& out, const MapletRequest& request) noexcept {
  out.varint(request.holder);
  write_key(out, request.key);
  std::uint32_t at = 0;
  for (const SeqRange& run : request.pieces) {
    out.varint(run.first - at);
    out.varint(run.end - run.first);
    at = run.end;
  }
}

std::optional<MapletRequest> read_maplet_request(std::span<const std::byte> body) noexcept {
  ByteReader in{body};
  MapletRequest request;
  request.holder = static_cast<std::uint16_t>(in.varint_to(0xFFFF));
  request.key = read_key(in);
  std::uint32_t at = 0;
  while (in.ok() && in.left() > 0) {
    const std::uint32_t first = at + read_u32(in, kMaxPieces);
    const std::uint32_t count = read_u32(in, kMaxPieces);
    if (full(request.pieces) || count == 0 || first + count > kMaxPieces) return {};
    request.pieces.push_back({first, first + count});
    at = first + count;
  }
  if (!in.ok()) return {};
  return request;
}

void write(ByteWriter& out, const MapletChunk& chunk) noexcept {
  write_key(out, chunk.key);
  out.varint(chunk.bytes);
  out.varint(chunk.first);
  out.bytes(chunk.data);
}

std::optional<MapletChunk> read_chunk(std::span<const std::byte> body) noexcept {
  ByteReader in{body};
  MapletChunk chunk;
  chunk.key = read_key(in);
  chunk.bytes = read_u32(in, kMaxMapletBytes);
  chunk.first = read_u32(in, kMaxPieces);
  chunk.data = in.bytes(in.left());
  const std::size_t start = chunk.first * kPieceBytes;
  const std::size_t end = start + chunk.data.size();
  const bool whole = chunk.data.size() % kPieceBytes == 0 || end == chunk.bytes;
  if (!in.ok() || chunk.data.empty() || end > chunk.bytes || !whole) return {};
  return chunk;
}

}  // namespace maplet
