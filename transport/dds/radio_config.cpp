// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/radio_config.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "transport/dds/config.hpp"

namespace maplet {

namespace {

// Each timer stands above the round trip with its queueing, and not far above (docs/dds.md).
constexpr const char* kWifiTimers =
    "<HeartbeatInterval max=\"8s\" min=\"1s\" minsched=\"1s\">2s</HeartbeatInterval>"
    "<NackDelay>500ms</NackDelay><AckDelay>500ms</AckDelay>"
    "<PreEmptiveAckDelay>1s</PreEmptiveAckDelay><AutoReschedNackDelay>20s</AutoReschedNackDelay>"
    "<MaxQueuedRexmitBytes>16KiB</MaxQueuedRexmitBytes>"
    "<BurstSize><MaxRexmit>4KiB</MaxRexmit></BurstSize>"
    "<SPDPResponseMaxDelay>1s</SPDPResponseMaxDelay>";
constexpr const char* kRadioTimers =
    "<HeartbeatInterval max=\"60s\" min=\"4s\" minsched=\"8s\">8s</HeartbeatInterval>"
    "<NackDelay>3s</NackDelay><AckDelay>3s</AckDelay>"
    "<PreEmptiveAckDelay>3s</PreEmptiveAckDelay><AutoReschedNackDelay>30s</AutoReschedNackDelay>"
    "<MaxQueuedRexmitBytes>4KiB</MaxQueuedRexmitBytes>"
    "<MaxQueuedRexmitMessages>10</MaxQueuedRexmitMessages>"
    "<BurstSize><MaxRexmit>2KiB</MaxRexmit></BurstSize>"
    "<RetransmitMerging>always</RetransmitMerging>"
    "<RetransmitMergingPeriod>1s</RetransmitMergingPeriod>"
    "<SPDPResponseMaxDelay>1s</SPDPResponseMaxDelay>";

}  // namespace

std::vector<std::string> RadioConfig::peer_list() const {
  std::vector<std::string> list;
  std::string one;
  for (const char c : peers + ",") {
    if (c == ',' || c == ' ') {
      if (!one.empty()) list.push_back(one);
      one.clear();
    } else {
      one += c;
    }
  }
  return list;
}

std::string RadioConfig::problem(int local_domain) const {
  if (radio_domain == local_domain) {
    return fmt::format("dds: radio_domain = {} must differ from dds.domain; -1 chooses",
                       radio_domain);
  }
  const auto peers_given = peer_list();
  for (const std::string& peer : peers_given) {
    in_addr parsed{};
    if (inet_pton(AF_INET, peer.c_str(), &parsed) != 1) {
      return fmt::format("dds: peers: '{}' is no IPv4 address; write addresses, by commas", peer);
    }
  }
  // Below this a datagram to all peers never fits what ByteBudget leaves to maplets while somebody
  // is away: half of ten seconds, of that three quarters.
  constexpr double kSecondsForOne = 3.75;
  const std::size_t copies = std::max<std::size_t>(1, peers_given.size());
  const double least =
      static_cast<double>((link_profile().datagram_bytes + kWireOverheadBytes) * copies) /
      kSecondsForOne;
  if (budget_bytes_per_s < least) {
    return fmt::format(
        "dds: budget_bytes_per_s = {} cannot carry a datagram of profile '{}' to {} "
        "peers: {:.0f} at least{}",
        budget_bytes_per_s, profile, copies, std::ceil(least),
        profile == "wifi" ? ", or profile 'radio'" : "");
  }
  return {};
}

std::string DdsSecurityFiles::xml() const {
  const auto library = [](const char* what, const char* short_name) {
    return fmt::format(
        "<Library initFunction=\"init_{0}\" finalizeFunction=\"finalize_{0}\" "
        "path=\"dds_security_{1}\"/>",
        what, short_name);
  };
  const auto file = [](const char* element, const std::string& path) {
    return fmt::format("<{0}>file:{1}</{0}>", element, xml_escaped(path));
  };
  std::error_code error;
  const bool any_revoked = std::filesystem::exists(revoked(), error);
  return "<Security><Authentication>" + library("authentication", "auth") +
         file("IdentityCA", authority()) + file("IdentityCertificate", identity()) +
         file("PrivateKey", private_key()) + (any_revoked ? file("CRL", revoked()) : "") +
         "</Authentication><Cryptographic>" + library("crypto", "crypto") +
         "</Cryptographic><AccessControl>" + library("access_control", "ac") +
         file("Governance", governance()) + file("PermissionsCA", authority()) +
         file("Permissions", permissions()) + "</AccessControl></Security>";
}

std::string cyclone_radio_xml(const RadioConfig& config, int participant_index, bool multicast,
                              const DdsSecurityFiles* security) {
  const bool slow = config.profile == "radio";
  const auto peer_list = config.peer_list();
  std::string peers;
  for (const auto& peer : peer_list) {
    peers += fmt::format("<Peer Address=\"{}\"/>", xml_escaped(peer));
  }
  if (!peers.empty()) peers = "<Peers>" + peers + "</Peers>";
  const bool unicast = !peer_list.empty() || !multicast;
  // With peers, each index is a copy of every announcement: one robot, one index.
  const int last_index = config.interface == "lo" ? kDaemonIndices - 1 : 0;
  return fmt::format(
      "<CycloneDDS><Domain Id=\"any\">"
      "<General><Interfaces><NetworkInterface name=\"{}\" multicast=\"{}\"/></Interfaces>"
      "<AllowMulticast>{}</AllowMulticast>"
      "<MaxMessageSize>1300B</MaxMessageSize><MaxRexmitMessageSize>1300B</MaxRexmitMessageSize>"
      "<FragmentSize>1280B</FragmentSize></General>"
      "<Discovery><ParticipantIndex>{}</ParticipantIndex>"
      "<MaxAutoParticipantIndex>{}</MaxAutoParticipantIndex>{}"
      "<SPDPInterval>120s</SPDPInterval><LeaseDuration>1200s</LeaseDuration></Discovery>"
      "<Internal><MultipleReceiveThreads>false</MultipleReceiveThreads>{}"
      "<SocketReceiveBufferSize min=\"64KiB\" max=\"256KiB\"/>"
      "<Watermarks><WhcHigh>64KiB</WhcHigh><WhcAdaptive>false</WhcAdaptive></Watermarks>"
      "<MaxSampleSize>{}</MaxSampleSize></Internal>"
      "<Sizing><ReceiveBufferSize>128KiB</ReceiveBufferSize>"
      "<ReceiveBufferChunkSize>32KiB</ReceiveBufferChunkSize></Sizing>"
      "{}{}"
      "</Domain></CycloneDDS>",
      xml_escaped(config.interface), unicast ? "default" : "true", unicast ? "false" : "true",
      participant_index, peer_list.empty() ? kDaemonIndices - 1 : last_index, peers,
      slow ? kRadioTimers : kWifiTimers, security != nullptr ? "32KiB" : "4KiB",
      cyclone_threads_xml(), security != nullptr ? security->xml() : "");
}

}  // namespace maplet
