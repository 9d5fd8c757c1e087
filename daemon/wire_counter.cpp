// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Linked into the program itself, not into the library: it stands before libc's sendmsg(), through
// which Cyclone sends everything, and counts for WireMeter.
#ifndef MAPLET_SANITIZED

#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "transport/dds/wire_meter.hpp"

extern "C" ssize_t sendmsg(int socket, const msghdr* message, int flags) {
  const auto sent = static_cast<ssize_t>(syscall(SYS_sendmsg, socket, message, flags));
  if (sent < 0 || message == nullptr || message->msg_name == nullptr) return sent;
  const auto* address = static_cast<const sockaddr*>(message->msg_name);
  if (address->sa_family == AF_INET) {
    const auto* to = static_cast<const sockaddr_in*>(message->msg_name);
    maplet::WireMeter::note(ntohs(to->sin_port), static_cast<std::size_t>(sent));
  }
  return sent;
}

namespace {
[[maybe_unused]] const bool available = maplet::WireMeter::available = true;
}

#endif
