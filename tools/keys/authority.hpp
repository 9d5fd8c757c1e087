// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "transport/security/validity.hpp"

namespace maplet::keys {

/// A certificate and its private key, both PEM.
struct Identity {
  std::string certificate;
  std::string private_key;
};

/// The certificate authority of a team, for DDS Security: EC P-256, SHA-256. It signs identities,
/// what they may do (S/MIME), and which of them are revoked.
class Authority {
 public:
  [[nodiscard]] static Authority make(const std::string& name, const Validity& validity);
  explicit Authority(Identity self) : self_{std::move(self)} {}

  [[nodiscard]] const Identity& self() const noexcept { return self_; }
  /// Whether there are a certificate and a key, and these belong together.
  [[nodiscard]] bool sound() const;
  [[nodiscard]] Identity issue(const std::string& name, std::uint64_t serial,
                               const Validity& validity) const;
  /// S/MIME, detached, as `openssl smime -sign -text` writes it.
  [[nodiscard]] std::string sign(const std::string& text) const;
  [[nodiscard]] std::string revoked(const std::vector<std::uint64_t>& serials,
                                    const Validity& validity) const;

 private:
  Identity self_;
};

/// Who may join and how it is protected: our topics and nothing else.
[[nodiscard]] std::string governance_xml();
/// What an identity may do: write and read our topics.
[[nodiscard]] std::string permissions_xml(const std::string& subject, const Validity& validity);

}  // namespace maplet::keys
