// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/config.hpp"

#include <fmt/format.h>

namespace maplet {

namespace {

// A sanitizer's frames are larger.
#ifdef MAPLET_SANITIZED
constexpr int kStackKib = 1024;
#else
constexpr int kStackKib = 128;
#endif

}  // namespace

std::string xml_escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string cyclone_threads_xml() {
  std::string threads;
  for (const char* name : {"recv", "tev", "dq.user", "dq.builtins", "gc"}) {
    threads +=
        fmt::format("<Thread Name=\"{}\"><StackSize>{}KiB</StackSize></Thread>", name, kStackKib);
  }
  return "<Threads>" + threads + "</Threads>";
}

std::string cyclone_xml(const DdsConfig& config, int participant_index, bool multicast) {
  std::string peers;
  if (config.interface == "lo") peers += "<Peer Address=\"127.0.0.1\"/>";
  for (const auto& peer : config.peers) {
    peers += fmt::format("<Peer Address=\"{}\"/>", xml_escaped(peer));
  }
  if (!peers.empty()) peers = "<Peers>" + peers + "</Peers>";

  // Multicast only finds others: data goes to each by unicast, so nobody else is woken. One receive
  // thread: with more, deleting a participant whose interface is gone never returns.
  return fmt::format(
      "<CycloneDDS><Domain Id=\"any\">"
      "<General><Interfaces><NetworkInterface name=\"{}\" multicast=\"{}\"/></Interfaces>"
      "<AllowMulticast>{}</AllowMulticast></General>"
      "<Discovery><ParticipantIndex>{}</ParticipantIndex>"
      "<MaxAutoParticipantIndex>{}</MaxAutoParticipantIndex>{}"
      "<SPDPInterval>2s</SPDPInterval><LeaseDuration>10s</LeaseDuration></Discovery>"
      "<Internal><MultipleReceiveThreads>false</MultipleReceiveThreads>"
      "<SocketReceiveBufferSize min=\"128KiB\" max=\"512KiB\"/>"
      "<Watermarks><WhcHigh>8MB</WhcHigh><WhcAdaptive>false</WhcAdaptive></Watermarks>"
      "<DefragReliableMaxSamples>8</DefragReliableMaxSamples>"
      "<MaxSampleSize>128KiB</MaxSampleSize>"
      "<MaxQueuedRexmitBytes>256KiB</MaxQueuedRexmitBytes>"
      "<WriterLingerDuration>200ms</WriterLingerDuration></Internal>"
      "<Sizing><ReceiveBufferSize>256KiB</ReceiveBufferSize>"
      "<ReceiveBufferChunkSize>64KiB</ReceiveBufferChunkSize></Sizing>"
      "{}"
      "</Domain></CycloneDDS>",
      xml_escaped(config.interface), multicast ? "true" : "default", multicast ? "spdp" : "false",
      participant_index, kParticipantIndices - 1, peers, cyclone_threads_xml());
}

}  // namespace maplet
