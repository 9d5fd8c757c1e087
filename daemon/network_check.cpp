// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/network_check.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace maplet::daemon {

namespace {

using Result = CheckResult::Result;

CheckResult ok(std::string name, std::string detail) {
  return {std::move(name), Result::kOk, std::move(detail), {}};
}

/// Calls `look` with the name and, or nullptr, the IPv4 address of each interface.
template <class Look>
void for_each_interface(Look look) {
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return;
  for (const ifaddrs* i = all; i != nullptr; i = i->ifa_next) {
    const bool ipv4 = i->ifa_addr != nullptr && i->ifa_addr->sa_family == AF_INET;
    look(i->ifa_name, i->ifa_flags,
         ipv4 ? reinterpret_cast<const sockaddr_in*>(i->ifa_addr) : nullptr);
  }
  freeifaddrs(all);
}

struct Interface {
  bool found = false;
  bool up = false;
  bool address = false;
  bool multicast = false;
};

Interface look_at(const std::string& name) {
  Interface interface;
  for_each_interface([&](const char* other, unsigned flags, const sockaddr_in* address) {
    if (name != other) return;
    interface.found = true;
    interface.up = interface.up || (flags & IFF_UP) != 0;
    interface.multicast = interface.multicast || (flags & IFF_MULTICAST) != 0;
    interface.address = interface.address || address != nullptr;
  });
  return interface;
}

/// The interface over which the kernel would reach an address; empty, and why in `problem`.
std::string way_to(const std::string& peer, std::string& problem) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(7400);  // connecting sends nothing
  inet_pton(AF_INET, peer.c_str(), &to.sin_addr);
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in from{};
  socklen_t size = sizeof from;
  std::string name;
  if (fd < 0 || connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0 ||
      getsockname(fd, reinterpret_cast<sockaddr*>(&from), &size) != 0) {
    problem = std::strerror(errno);
  } else {
    for_each_interface([&](const char* other, unsigned, const sockaddr_in* address) {
      if (address != nullptr && address->sin_addr.s_addr == from.sin_addr.s_addr) name = other;
    });
    if (name.empty()) problem = "no interface has the address that leads there";
  }
  if (fd >= 0) close(fd);
  return name;
}

void check_peers(std::vector<CheckResult>& results, const RadioConfig& radio,
                 const Interface& interface) {
  const auto peers = radio.peer_list();
  if (peers.empty() && radio.interface != "lo" && !interface.multicast) {
    results.push_back(
        {"peers", Result::kWarn,
         "dds.interface '" + radio.interface + "' has no multicast, and dds.peers is empty",
         "name the other agents' addresses in dds.peers"});
  } else if (peers.empty()) {
    results.push_back(ok(
        "peers", radio.interface == "lo"
                     ? "other agents are looked for on this machine"
                     : "other agents are looked for by multicast (mapletctl peers: who is heard)"));
  }
  for (const std::string& peer : peers) {
    std::string problem;
    const std::string way = way_to(peer, problem);
    if (way.empty()) {
      results.push_back({"peers", Result::kWarn, fmt::format("{}: {}", peer, problem),
                         "correct dds.peers, or give this machine an address in that network"});
    } else if (way != radio.interface) {
      results.push_back({"peers", Result::kWarn,
                         fmt::format("{} is reached over {}, and dds.interface is '{}'", peer, way,
                                     radio.interface),
                         fmt::format("set dds.interface = \"{}\", or correct dds.peers", way)});
    } else {
      results.push_back(ok("peers", fmt::format("{} is reached over {}", peer, way)));
    }
  }
}

}  // namespace

void check_network(std::vector<CheckResult>& results, const RadioConfig& radio) {
  const Interface interface = look_at(radio.interface);
  const std::string name = "dds.interface '" + radio.interface + "'";
  if (!interface.found) {
    results.push_back({"network", Result::kWarn, name + " does not exist",
                       "the daemon waits for it; name another one if that is wrong (ip link)"});
    return;
  }
  if (!interface.up || !interface.address) {
    results.push_back({"network", Result::kWarn,
                       name + (interface.up ? " has no IPv4 address" : " is down"),
                       "the daemon waits for it"});
    return;
  }
  results.push_back(ok(
      "network",
      name + (radio.interface == "lo" ? " is up: other agents on this machine only" : " is up")));
  check_peers(results, radio, interface);
}

}  // namespace maplet::daemon
