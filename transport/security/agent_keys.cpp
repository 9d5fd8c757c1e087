// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/agent_keys.hpp"

#include <algorithm>

#include "transport/exchange/byte_io.hpp"

namespace maplet {

namespace {

constexpr std::uint64_t kVersion = 1;
constexpr std::size_t kMostBytes = 512;

template <std::size_t N>
void take(ByteReader& in, std::span<std::byte, N> out) noexcept {
  const auto bytes = in.bytes(N);
  std::copy(bytes.begin(), bytes.end(), out.begin());
}

}  // namespace

TeamId team_of(const VerifyingKey& operator_key) noexcept {
  TeamId id{};
  digest(id, operator_key);
  return id;
}

std::vector<std::byte> to_bytes(const AgentKeys& keys, const SigningKey& signer) {
  std::vector<std::byte> bytes(kMostBytes);
  ByteWriter out{bytes};
  out.fixed(kVersion, 1);
  out.bytes(keys.operator_key);
  out.fixed(keys.agent, 2);
  out.fixed(keys.generation, 4);
  out.fixed(static_cast<std::uint64_t>(keys.validity.not_before_s), 5);
  out.fixed(static_cast<std::uint64_t>(keys.validity.not_after_s), 5);
  out.bytes(keys.own.bytes());
  out.bytes(keys.group.bytes());
  out.fixed(keys.revoked.size(), 1);
  for (const std::uint16_t agent : keys.revoked) out.fixed(agent, 2);
  out.bytes(sign(signer, std::span{bytes}.first(out.size())));
  bytes.resize(out.size());
  return bytes;
}

tl::expected<AgentKeys, std::string> read_agent_keys(std::span<const std::byte> bytes) {
  ByteReader in{bytes};
  AgentKeys keys;
  if (in.fixed(1) != kVersion) return tl::unexpected<std::string>{"made by another version"};
  take(in, std::span{keys.operator_key});
  keys.agent = static_cast<std::uint16_t>(in.fixed(2));
  keys.generation = static_cast<std::uint32_t>(in.fixed(4));
  keys.validity.not_before_s = static_cast<std::int64_t>(in.fixed(5));
  keys.validity.not_after_s = static_cast<std::int64_t>(in.fixed(5));
  take(in, keys.own.bytes());
  take(in, keys.group.bytes());
  const std::uint64_t revoked = in.fixed(1);
  for (std::uint64_t i = 0; i < revoked && in.ok() && !full(keys.revoked); ++i) {
    keys.revoked.push_back(static_cast<std::uint16_t>(in.fixed(2)));
  }
  const std::size_t signed_bytes = bytes.size() - in.left();
  Signature signature{};
  take(in, std::span{signature});
  if (!in.ok() || in.left() != 0 || revoked > keys.revoked.capacity()) {
    return tl::unexpected<std::string>{"truncated, or no agent's keys"};
  }
  if (!verify(keys.operator_key, bytes.first(signed_bytes), signature)) {
    return tl::unexpected<std::string>{"damaged: its signature does not fit"};
  }
  return keys;
}

}  // namespace maplet
