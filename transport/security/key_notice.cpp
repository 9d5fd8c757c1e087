// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/key_notice.hpp"

#include <algorithm>

#include "transport/exchange/byte_io.hpp"
#include "transport/security/frame.hpp"

namespace maplet {

namespace {

constexpr std::size_t kSignatureBytes = sizeof(Signature);
constexpr std::size_t kFixedBytes = 1 + 8 + 4 + 2 + 10 + 32 + 2 + kSignatureBytes;
constexpr std::size_t kSealedBytes = 2 + 16;

template <std::size_t N>
void take(ByteReader& in, std::array<std::byte, N>& out) noexcept {
  const auto bytes = in.bytes(N);
  std::copy(bytes.begin(), bytes.end(), out.begin());
}

/// Hides the key, or shows it again: a pad that is used once, for the passing key is.
std::array<std::byte, 16> padded(std::span<const std::byte> key, const Secret<32>& shared,
                                 const ExchangePublic& passing, const ExchangePublic& robot,
                                 std::uint32_t generation) noexcept {
  std::array<std::byte, 68> salt{};
  ByteWriter out{salt};
  out.bytes(passing);
  out.bytes(robot);
  out.fixed(generation, 4);
  Secret<16> pad;
  derive(pad.bytes(), shared.bytes(), salt, "mapletd key notice");
  std::array<std::byte, 16> result{};
  for (std::size_t i = 0; i < result.size(); ++i) result[i] = key[i] ^ pad.bytes()[i];
  return result;
}

}  // namespace

const KeyNotice::Sealed* KeyNotice::find(std::uint16_t agent) const noexcept {
  const auto at = std::ranges::find(sealed, agent, &Sealed::agent);
  return at == sealed.end() ? nullptr : &*at;
}

std::size_t sealed_in_a_part(std::size_t revoked) noexcept {
  return std::min((kMaxNoticeBytes - kFixedBytes - 2 * revoked) / kSealedBytes,
                  KeyNotice::kMaxSealed);
}

KeyNotice::Sealed seal_for(std::uint16_t agent, const ExchangePublic& robot,
                           const ExchangeKey& passing, std::uint32_t generation,
                           const GroupKey& next) noexcept {
  KeyNotice::Sealed sealed{agent, {}};
  const auto shared = shared_secret(passing, robot);
  if (shared) {
    sealed.key = padded(next.bytes(), *shared, exchange_public(passing), robot, generation);
  }
  return sealed;
}

std::vector<std::byte> to_bytes(const KeyNotice& notice, const SigningKey& signer) {
  std::vector<std::byte> bytes(kMaxNoticeBytes);
  ByteWriter out{bytes};
  out.fixed(static_cast<std::uint64_t>(FrameKind::kNotice), 1);
  out.bytes(notice.team);
  out.fixed(notice.generation, 4);
  out.fixed(notice.part, 1);
  out.fixed(notice.parts, 1);
  out.fixed(static_cast<std::uint64_t>(notice.validity.not_before_s), 5);
  out.fixed(static_cast<std::uint64_t>(notice.validity.not_after_s), 5);
  out.bytes(notice.passing);
  out.fixed(notice.revoked.size(), 1);
  for (const std::uint16_t agent : notice.revoked) out.fixed(agent, 2);
  out.fixed(notice.sealed.size(), 1);
  for (const KeyNotice::Sealed& sealed : notice.sealed) {
    out.fixed(sealed.agent, 2);
    out.bytes(sealed.key);
  }
  out.bytes(sign(signer, std::span{bytes}.first(out.size())));
  bytes.resize(out.ok() ? out.size() : 0);
  return bytes;
}

std::optional<KeyNotice> read_key_notice(std::span<const std::byte> bytes) noexcept {
  if (bytes.size() > kMaxNoticeBytes) return {};
  ByteReader in{bytes};
  KeyNotice notice;
  if (in.fixed(1) != static_cast<std::uint64_t>(FrameKind::kNotice)) return {};
  take(in, notice.team);
  notice.generation = static_cast<std::uint32_t>(in.fixed(4));
  notice.part = static_cast<std::uint8_t>(in.fixed(1));
  notice.parts = static_cast<std::uint8_t>(in.fixed(1));
  notice.validity.not_before_s = static_cast<std::int64_t>(in.fixed(5));
  notice.validity.not_after_s = static_cast<std::int64_t>(in.fixed(5));
  take(in, notice.passing);
  const std::uint64_t revoked = in.fixed(1);
  if (revoked > notice.revoked.capacity()) return {};
  for (std::uint64_t i = 0; i < revoked; ++i) {
    notice.revoked.push_back(static_cast<std::uint16_t>(in.fixed(2)));
  }
  const std::uint64_t sealed = in.fixed(1);
  if (sealed > notice.sealed.capacity()) return {};
  for (std::uint64_t i = 0; i < sealed; ++i) {
    KeyNotice::Sealed one;
    one.agent = static_cast<std::uint16_t>(in.fixed(2));
    take(in, one.key);
    notice.sealed.push_back(one);
  }
  const bool parts = notice.part < notice.parts && notice.parts <= KeyNotice::kMaxParts;
  if (!in.ok() || in.left() != kSignatureBytes || !parts) return {};
  return notice;
}

bool signed_by(const VerifyingKey& operator_key, std::span<const std::byte> bytes) noexcept {
  if (bytes.size() < kSignatureBytes) return false;
  Signature signature{};
  std::ranges::copy(bytes.last(kSignatureBytes), signature.begin());
  return verify(operator_key, bytes.first(bytes.size() - kSignatureBytes), signature);
}

std::optional<GroupKey> open_for(const AgentKeys& keys, const KeyNotice& notice) noexcept {
  const KeyNotice::Sealed* sealed = notice.find(keys.agent);
  if (sealed == nullptr) return {};
  const auto shared = shared_secret(keys.own, notice.passing);
  if (!shared) return {};
  GroupKey next;
  const auto key =
      padded(sealed->key, *shared, notice.passing, exchange_public(keys.own), notice.generation);
  std::ranges::copy(key, next.bytes().begin());
  return next;
}

bool follow(AgentKeys& keys, const KeyNotice& notice) noexcept {
  if (notice.generation < keys.generation) return false;
  keys.revoked = notice.revoked;
  if (notice.generation == keys.generation) return false;
  const auto next = open_for(keys, notice);
  if (!next) return false;
  keys.group = *next;
  keys.generation = notice.generation;
  keys.validity = notice.validity;
  return true;
}

}  // namespace maplet
