// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "transport/security/secret.hpp"

namespace maplet {

// What is used of libcrypto, by its standards' names. None of it throws; a failure of the library
// itself (no memory, no random numbers) terminates: nothing goes out half secured.

/// Unpredictable bytes.
void fill_random(std::span<std::byte> out) noexcept;

/// HKDF-SHA256 (RFC 5869). `out` has at most 32 bytes.
void derive(std::span<std::byte> out, std::span<const std::byte> secret,
            std::span<const std::byte> salt, std::string_view purpose) noexcept;

/// SHA-256. `out` takes its first bytes, at most 32.
void digest(std::span<std::byte> out, std::span<const std::byte> bytes) noexcept;

/// Ed25519 (RFC 8032).
using SigningKey = Secret<32>;
using VerifyingKey = std::array<std::byte, 32>;
using Signature = std::array<std::byte, 64>;
[[nodiscard]] VerifyingKey verifying_key(const SigningKey& key) noexcept;
[[nodiscard]] Signature sign(const SigningKey& key, std::span<const std::byte> message) noexcept;
[[nodiscard]] bool verify(const VerifyingKey& key, std::span<const std::byte> message,
                          const Signature& signature) noexcept;

/// X25519 (RFC 7748).
using ExchangeKey = Secret<32>;
using ExchangePublic = std::array<std::byte, 32>;
[[nodiscard]] ExchangePublic exchange_public(const ExchangeKey& key) noexcept;
/// @return what both sides share; nothing when `other` is no point that may be used
[[nodiscard]] std::optional<Secret<32>> shared_secret(const ExchangeKey& key,
                                                      const ExchangePublic& other) noexcept;

/// AES-128-CCM with nonces of 13 bytes and tags of 8 (AES-CCM-16-64-128 of RFC 9053, what RFC 8613
/// uses by default): made for short messages on slow links.
///
/// Memory   two contexts of libcrypto, at construction; none in seal() and open().
/// Time     under a microsecond for 480 bytes where the processor has AES. Threads one.
class Aead {
 public:
  static constexpr std::size_t kKeyBytes = 16;
  static constexpr std::size_t kNonceBytes = 13;
  static constexpr std::size_t kTagBytes = 8;
  using Key = Secret<kKeyBytes>;
  using Nonce = std::array<std::byte, kNonceBytes>;

  Aead() noexcept;
  ~Aead();
  Aead(const Aead&) = delete;
  Aead& operator=(const Aead&) = delete;

  /// Needed before anything is sealed or opened.
  void set_key(const Key& key) noexcept;
  /// @param out  text.size() + kTagBytes
  void seal(const Nonce& nonce, std::span<const std::byte> head, std::span<const std::byte> text,
            std::span<std::byte> out) noexcept;
  /// @param out  sealed.size() - kTagBytes; of no use when it fails
  [[nodiscard]] bool open(const Nonce& nonce, std::span<const std::byte> head,
                          std::span<const std::byte> sealed, std::span<std::byte> out) noexcept;

 private:
  struct Contexts;
  std::unique_ptr<Contexts> contexts_;
};

}  // namespace maplet
