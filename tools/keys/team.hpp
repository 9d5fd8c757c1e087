// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/keys/authority.hpp"
#include "transport/security/key_notice.hpp"

namespace maplet::keys {

inline constexpr const char* kTeamFile = "team.json";
inline constexpr const char* kRevokedFile = "crl.pem";

/// An operator's team: a folder that only the operator reads.
///
///   team.json       the operator's signing key, the group's key, who has which public key (0600)
///   ca.key.pem      the certificate authority (0600); ca.pem its certificate
///   agent-N/        what agent N gets: agent.keys and DDS Security's files
///   newest.notice   after `revoke` and `rotate`: for the robots, over any of them
///   crl.pem         certificates revoked
///
/// What goes wrong is thrown as a line: what, where, remedy.
class Team {
 public:
  struct Robot {
    std::uint16_t agent = 0;
    ExchangePublic key{};
    std::uint64_t serial = 0;  ///< of its certificate
    std::int64_t not_after_s = 0;
  };

  static constexpr std::size_t kLongestName = 64;  ///< of a certificate, RFC 5280

  /// Makes the folder, unless there are keys in it. @param days  that the keys are good for
  [[nodiscard]] static Team init(const std::string& dir, const std::string& name, int days,
                                 std::int64_t now_s);
  [[nodiscard]] static Team open(const std::string& dir);

  /// Writes what one robot gets, in a folder that holds nobody else's keys.
  /// @param renew  it had keys already: these go
  /// @return the folder
  std::string add(std::uint16_t agent, const std::string& out, int days, bool renew,
                  std::int64_t now_s);
  /// The next generation of keys, without some. Where all of these were revoked before, nothing but
  /// the files that tell of it, again. @return the notice's file
  std::string rotate(const std::vector<std::uint16_t>& gone, int days, std::int64_t now_s);

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] TeamId id() const noexcept { return team_of(verifying_key(operator_key_)); }
  [[nodiscard]] std::uint32_t generation() const noexcept { return generation_; }
  [[nodiscard]] const Validity& validity() const noexcept { return validity_; }
  [[nodiscard]] const std::vector<Robot>& robots() const noexcept { return robots_; }
  [[nodiscard]] const std::vector<std::uint16_t>& revoked() const noexcept { return revoked_; }

 private:
  void save() const;
  [[nodiscard]] bool occupied(const std::string& folder, std::uint16_t agent, bool renew) const;
  /// Takes their keys away. @return whether one of them still had some
  bool remove(const std::vector<std::uint16_t>& gone);
  [[nodiscard]] std::string notice() const;
  [[nodiscard]] Revoked latest_revoked() const;
  [[nodiscard]] Authority authority() const;

  std::string dir_;
  std::string name_;
  SigningKey operator_key_;
  GroupKey group_;
  std::uint32_t generation_ = 1;
  Validity validity_;
  std::uint64_t next_serial_ = 2;
  std::vector<Robot> robots_;
  std::vector<std::uint16_t> revoked_;
  std::vector<std::uint64_t> revoked_serials_;
};

[[nodiscard]] std::string to_hex(std::span<const std::byte> bytes);

}  // namespace maplet::keys
