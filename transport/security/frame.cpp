// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/frame.hpp"

#include "core/base/crc.hpp"
#include "transport/exchange/byte_io.hpp"

namespace maplet {

Aead::Nonce FrameHead::nonce() const noexcept {
  Aead::Nonce bytes{};
  ByteWriter out{bytes};
  out.fixed(agent, 2);
  out.fixed(session, 8);
  out.fixed(counter, 3);
  return bytes;
}

void write(std::span<std::byte, kFrameHeadBytes> bytes, const FrameHead& head) noexcept {
  ByteWriter out{bytes};
  out.fixed(static_cast<std::uint64_t>(head.kind), 1);
  out.fixed(head.generation, 1);
  out.bytes(head.nonce());
}

std::optional<FrameHead> read_frame_head(std::span<const std::byte> bytes) noexcept {
  ByteReader in{bytes};
  FrameHead head;
  head.kind = static_cast<FrameKind>(in.fixed(1));
  head.generation = static_cast<std::uint8_t>(in.fixed(1));
  head.agent = static_cast<std::uint16_t>(in.fixed(2));
  head.session = in.fixed(8);
  head.counter = static_cast<std::uint32_t>(in.fixed(3));
  const bool sealed = head.kind == FrameKind::kSealed || head.kind == FrameKind::kTalk;
  if (!in.ok() || !sealed || in.left() <= Aead::kTagBytes) return {};
  return head;
}

std::span<const std::byte> text_of(std::span<const std::byte> datagram) noexcept {
  if (datagram.size() < kDatagramHeadBytes + kDatagramCrcBytes) return {};
  return datagram.subspan(kTextAt, datagram.size() - kTextAt - kDatagramCrcBytes);
}

std::span<const std::byte> datagram_of(std::span<std::byte> out, std::size_t text_bytes,
                                       std::uint16_t agent) noexcept {
  const std::size_t before_crc = kTextAt + text_bytes;
  ByteWriter head{out.first(kTextAt)};
  head.fixed(static_cast<std::uint64_t>(FrameKind::kPlain), 1);
  head.fixed(agent, 2);
  ByteWriter tail{out.subspan(before_crc, kDatagramCrcBytes)};
  tail.fixed(crc32c(out.first(before_crc)), 4);
  return out.first(before_crc + kDatagramCrcBytes);
}

}  // namespace maplet
