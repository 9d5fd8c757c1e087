// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/socket.h>

#include <string>
#include <tl/expected.hpp>

namespace maplet::daemon {

/// Where datagrams go: `udp:ADDRESS:PORT`, `udp:[IPV6]:PORT`, `unix:PATH`, or `unix:@NAME` of the
/// abstract namespace. Numbers only: nobody waits for a name server.
struct DatagramAddress {
  sockaddr_storage address{};
  socklen_t size = 0;

  /// @return the address, or one line: what is wrong with it
  [[nodiscard]] static tl::expected<DatagramAddress, std::string> parse(const std::string& text);
};

}  // namespace maplet::daemon
