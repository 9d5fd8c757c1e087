// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "transport/security/agent_keys.hpp"

namespace maplet {

inline constexpr std::size_t kMaxNoticeBytes = 480;  ///< a datagram of profile `radio`

/// The operator's word that a new generation of keys has begun: the next group key, sealed for each
/// robot that stays. Signed, so that anybody may carry it; who is not in it cannot go on. Large
/// teams have it in parts, each complete in itself.
struct KeyNotice {
  /// The group's key under what the operator's passing key and the robot's own key share.
  struct Sealed {
    std::uint16_t agent = 0;
    std::array<std::byte, 16> key{};
  };
  static constexpr std::size_t kMaxSealed = 19;
  static constexpr std::size_t kMaxParts = 64;

  TeamId team{};
  std::uint32_t generation = 0;
  std::uint8_t part = 0;
  std::uint8_t parts = 1;
  Validity validity;
  ExchangePublic passing{};
  Revoked revoked;
  StaticVector<Sealed, kMaxSealed> sealed;

  [[nodiscard]] const Sealed* find(std::uint16_t agent) const noexcept;
};

/// How many robots fit into a part.
[[nodiscard]] std::size_t sealed_in_a_part(std::size_t revoked) noexcept;

/// Seals the next group key for one robot.
[[nodiscard]] KeyNotice::Sealed seal_for(std::uint16_t agent, const ExchangePublic& robot,
                                         const ExchangeKey& passing, std::uint32_t generation,
                                         const GroupKey& next) noexcept;

/// As bytes, signed:
///
///   octet      0xA4
///   8 u32      team, generation
///   octet x 2  part, parts
///   u40 u40    not before, not after
///   32         the passing X25519 public key
///   octet      how many were revoked; u16 each
///   octet      how many keys; u16 agent and 16 bytes each
///   64         Ed25519 of everything before
[[nodiscard]] std::vector<std::byte> to_bytes(const KeyNotice& notice, const SigningKey& signer);

/// Reads what anybody sent. The signature is another matter: signed_by().
/// Memory none. @return nothing when it makes no sense
[[nodiscard]] std::optional<KeyNotice> read_key_notice(std::span<const std::byte> bytes) noexcept;
[[nodiscard]] bool signed_by(const VerifyingKey& operator_key,
                             std::span<const std::byte> bytes) noexcept;

/// @return the next group key; nothing when the notice has none for these keys
[[nodiscard]] std::optional<GroupKey> open_for(const AgentKeys& keys,
                                               const KeyNotice& notice) noexcept;

/// Keys after a verified notice: who is revoked, and the next generation where it has a key for
/// them. One of an earlier generation changes nothing.
/// @return whether the group's key is another one
bool follow(AgentKeys& keys, const KeyNotice& notice) noexcept;

}  // namespace maplet
