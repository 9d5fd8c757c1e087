// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "core/base/static_vector.hpp"
#include "transport/security/crypto.hpp"
#include "transport/security/validity.hpp"

namespace maplet {

/// What a whole team shares: whoever has it reads and speaks. One a generation.
using GroupKey = Secret<16>;

/// A team, by its operator's public key.
using TeamId = std::array<std::byte, 8>;
[[nodiscard]] TeamId team_of(const VerifyingKey& operator_key) noexcept;

/// Agents whose keys were revoked, the latest ones: who is named, not who is shut out (that is
/// whoever did not get the next group key).
using Revoked = StaticVector<std::uint16_t, 64>;

/// What one robot has: the file agent.keys.
struct AgentKeys {
  VerifyingKey operator_key{};
  std::uint16_t agent = 0;
  std::uint32_t generation = 0;
  Validity validity;
  ExchangeKey own;
  GroupKey group;
  Revoked revoked;
};

/// As bytes, signed by the operator:
///
///   octet    version (1)
///   32       operator's Ed25519 public key
///   u16 u32  agent, generation
///   u40 u40  not before, not after: seconds since 1970
///   32 16    the agent's X25519 key, the group's key
///   octet    how many agents were revoked; u16 each
///   64       Ed25519 of everything before
[[nodiscard]] std::vector<std::byte> to_bytes(const AgentKeys& keys, const SigningKey& signer);

/// @return the keys, or what is wrong with the bytes
[[nodiscard]] tl::expected<AgentKeys, std::string> read_agent_keys(
    std::span<const std::byte> bytes);

}  // namespace maplet
