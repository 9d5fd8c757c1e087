// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/journal/format.hpp"

#include "core/base/crc.hpp"
#include "daemon/journal/mend.hpp"
#include "transport/exchange/byte_io.hpp"

namespace maplet::journal {

namespace {

constexpr std::uint32_t kMagic = 0x6E72746D;  // "mtrn"
constexpr std::size_t kSummed = 8;            // from here on the head's checksum counts

}  // namespace

std::uint32_t fnv1a(std::span<const std::byte> bytes) noexcept {
  std::uint32_t hash = 2166136261U;
  for (const std::byte b : bytes) hash = (hash ^ std::to_integer<std::uint32_t>(b)) * 16777619U;
  return hash;
}

void seal(TurnHead head, std::span<std::byte> turn) noexcept {
  const auto payload = turn.subspan(kHeadBytes);
  head.payload_bytes = static_cast<std::uint32_t>(payload.size());
  head.payload_crc = crc32c(payload);
  head.payload_fnv = fnv1a(payload);
  ByteWriter out{turn.first(kHeadBytes)};
  out.fixed(kMagic, 4);
  out.fixed(0, 4);
  out.fixed(head.version, 2);
  out.fixed(head.life.agent, 2);
  out.fixed(head.life.epoch, 4);
  out.fixed(head.generation, 4);
  out.fixed(head.number, 4);
  out.fixed(head.payload_bytes, 4);
  out.fixed(head.payload_crc, 4);
  out.fixed(head.payload_fnv, 4);
  out.fixed(head.half_pages, 4);
  out.fixed(head.carried ? 1 : 0, 4);
  for (const std::uint32_t end : head.ends) out.fixed(end, 4);
  out.fixed(0, 4);
  ByteWriter crc{turn.subspan(4, 4)};
  crc.fixed(crc32c(turn.subspan(kSummed, kHeadBytes - kSummed)), 4);
}

std::optional<TurnHead> read_head(std::span<std::byte> bytes, std::uint32_t& mended) noexcept {
  ByteReader in{bytes.first(kHeadBytes)};
  // A magic with a flipped bit is one, if all the rest is whole.
  const std::uint64_t magic = in.fixed(4) ^ kMagic;
  if ((magic & (magic - 1)) != 0) return {};
  const auto crc = static_cast<std::uint32_t>(in.fixed(4));
  const Mend state = mend(bytes.subspan(kSummed, kHeadBytes - kSummed), crc);
  if (state == Mend::kBroken || (magic != 0 && state != Mend::kWhole)) return {};
  TurnHead head;
  head.version = static_cast<std::uint16_t>(in.fixed(2));
  head.life.agent = static_cast<std::uint16_t>(in.fixed(2));
  head.life.epoch = static_cast<std::uint32_t>(in.fixed(4));
  head.generation = static_cast<std::uint32_t>(in.fixed(4));
  head.number = static_cast<std::uint32_t>(in.fixed(4));
  head.payload_bytes = static_cast<std::uint32_t>(in.fixed(4));
  head.payload_crc = static_cast<std::uint32_t>(in.fixed(4));
  head.payload_fnv = static_cast<std::uint32_t>(in.fixed(4));
  head.half_pages = static_cast<std::uint32_t>(in.fixed(4));
  head.carried = in.fixed(4) != 0;
  for (std::uint32_t& end : head.ends) end = static_cast<std::uint32_t>(in.fixed(4));
  if (head.version == 0 || head.generation == 0 || head.half_pages == 0 ||
      head.payload_bytes > kMaxPayloadBytes) {
    return {};
  }
  if (magic != 0 || state != Mend::kWhole) ++mended;
  return head;
}

bool check_payload(const TurnHead& head, std::span<std::byte> payload,
                   std::uint32_t& mended) noexcept {
  const Mend state = mend(payload, head.payload_crc);
  if (state == Mend::kWhole) return true;
  if (state == Mend::kBroken || fnv1a(payload) != head.payload_fnv) return false;
  ++mended;
  return true;
}

}  // namespace maplet::journal
