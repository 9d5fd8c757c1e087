// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "transport/exchange/datagram.hpp"
#include "transport/security/crypto.hpp"

namespace maplet {

/// What goes over the air, by its first octet.
enum class FrameKind : std::uint8_t {
  kPlain = 0xA0 | kDatagramVersion,  ///< exchange/datagram.hpp, as it is
  kSealed = 0xA2,                    ///< a datagram, sealed
  kTalk = 0xA3,                      ///< challenges and proofs, sealed
  kNotice = 0xA4,                    ///< key_notice.hpp
};

/// What stands before sealed bytes; authenticated, not hidden.
///
///   octet        0xA2 or 0xA3
///   octet        the key's generation, its low 8 bits
///   u16 u64 u24  agent, session, counter
///   sealed text, then a tag of 8 bytes
///
/// Of a datagram the text leaves out what the head or the tag says: its first octet, its agent and
/// its CRC. Agent, session and counter are the nonce. A session is drawn at random at each start
/// and when the counters are used up, so a nonce never comes twice under one key.
struct FrameHead {
  FrameKind kind = FrameKind::kSealed;
  std::uint8_t generation = 0;
  std::uint16_t agent = 0;
  std::uint64_t session = 0;
  std::uint32_t counter = 0;

  [[nodiscard]] Aead::Nonce nonce() const noexcept;
};
/// Whether somebody who has keys said it, or says so.
[[nodiscard]] inline bool is_secured(std::span<const std::byte> frame) noexcept {
  return !frame.empty() && frame[0] >= static_cast<std::byte>(FrameKind::kSealed) &&
         frame[0] <= static_cast<std::byte>(FrameKind::kNotice);
}

inline constexpr std::size_t kFrameHeadBytes = 15;
inline constexpr std::uint32_t kLastCounter = 0xFFFFFF;
/// What sealing adds to a datagram.
inline constexpr std::size_t kSealBytes = kFrameHeadBytes + Aead::kTagBytes - 3 - kDatagramCrcBytes;

void write(std::span<std::byte, kFrameHeadBytes> out, const FrameHead& head) noexcept;
/// @return nothing when it is no sealed frame
[[nodiscard]] std::optional<FrameHead> read_frame_head(std::span<const std::byte> bytes) noexcept;

/// The part of a datagram that is sealed. @return nothing when it is no datagram
[[nodiscard]] std::span<const std::byte> text_of(std::span<const std::byte> datagram) noexcept;
/// Makes a datagram of `out` again, whose text stands behind its first three bytes.
/// @param text_bytes  of it. @return the datagram
[[nodiscard]] std::span<const std::byte> datagram_of(std::span<std::byte> out,
                                                     std::size_t text_bytes,
                                                     std::uint16_t agent) noexcept;
inline constexpr std::size_t kTextAt = 3;  ///< where the text of a datagram begins

}  // namespace maplet
