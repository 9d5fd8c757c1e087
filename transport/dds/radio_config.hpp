// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "core/base/field.hpp"
#include "transport/sync/sync_config.hpp"

namespace maplet {

/// The link to the other agents: a DDS domain and participant of its own.
struct RadioConfig {
  std::string profile = "wifi";
  std::string interface = "lo";
  std::string peers;
  int radio_domain = -1;
  int budget_bytes_per_s = 4000;

  static constexpr Field<RadioConfig> kFields[] = {
      {"profile", &RadioConfig::profile, 0, 0,
       "Link to other agents: wifi (64 kbit/s and more, a topic a kind) or radio (20 kbit/s and "
       "less, packed)",
       "wifi|radio"},
      {"interface", &RadioConfig::interface, 0, 0, "Network interface of that link"},
      {"peers", &RadioConfig::peers, 0, 0,
       "IPv4 addresses of other agents, by commas: unicast to these; empty = multicast"},
      {"radio_domain", &RadioConfig::radio_domain, -1, 230,
       "DDS domain of that link, the same for all agents; -1 = dds.domain + 1"},
      {"budget_bytes_per_s", &RadioConfig::budget_bytes_per_s, 100, 1e9,
       "IP bytes that this agent may put on the link, DDS's own included"},
  };

  /// The domain of the link, given dds.domain.
  [[nodiscard]] int domain(int local_domain) const noexcept {
    if (radio_domain >= 0) return radio_domain;
    return local_domain < 230 ? local_domain + 1 : local_domain - 1;
  }
  [[nodiscard]] LinkProfile link_profile() const noexcept {
    return profile == "radio" ? radio_profile() : wifi_profile();
  }
  [[nodiscard]] std::vector<std::string> peer_list() const;
  /// @return what is wrong with it beside a local domain, in one line, or nothing
  [[nodiscard]] std::string problem(int local_domain) const;
};

/// What DDS, UDP and IP add to a datagram of ours (docs/dds.md).
inline constexpr std::size_t kWireOverheadBytes = 92;

/// The same inside DDS Security, data encrypted and signed (docs/security.md).
inline constexpr std::size_t kSecuredWireOverheadBytes = 160;

/// What DDS Security reads of the folder that `mapletctl keys agent` wrote.
struct DdsSecurityFiles {
  std::string dir;

  [[nodiscard]] std::string authority() const { return dir + "/ca.pem"; }
  [[nodiscard]] std::string identity() const { return dir + "/identity.pem"; }
  [[nodiscard]] std::string private_key() const { return dir + "/identity.key.pem"; }
  [[nodiscard]] std::string governance() const { return dir + "/governance.p7s"; }
  [[nodiscard]] std::string permissions() const { return dir + "/permissions.p7s"; }
  [[nodiscard]] std::string revoked() const { return dir + "/crl.pem"; }  ///< may be missing
  [[nodiscard]] std::vector<std::string> open_files() const {
    return {authority(), identity(), governance(), permissions()};
  }
  /// The element of Cyclone's configuration.
  [[nodiscard]] std::string xml() const;
};

/// Cyclone's configuration for the link: patient timers, bounded memory, no data but ours.
[[nodiscard]] std::string cyclone_radio_xml(const RadioConfig& config, int participant_index,
                                            bool multicast,
                                            const DdsSecurityFiles* security = nullptr);

}  // namespace maplet
