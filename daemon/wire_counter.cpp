// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Linked into the program itself, not into the library: it stands before libc's sendmsg(), through
// which Cyclone sends everything, counts for WireMeter, and holds back what goes beyond its limit.
#ifndef MAPLET_SANITIZED

#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "transport/dds/wire_meter.hpp"

namespace {

std::size_t bytes_of(const msghdr& message) noexcept {
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < message.msg_iovlen; ++i) bytes += message.msg_iov[i].iov_len;
  return bytes;
}

/// Whether it is the radio's, and over its limit.
bool held_back(const msghdr* message) noexcept {
  if (message == nullptr || message->msg_name == nullptr) return false;
  const auto* address = static_cast<const sockaddr*>(message->msg_name);
  if (address->sa_family != AF_INET) return false;
  const auto* to = static_cast<const sockaddr_in*>(message->msg_name);
  return maplet::WireMeter::watched(ntohs(to->sin_port)) &&
         !maplet::WireMeter::pass(bytes_of(*message), maplet::MonotonicClock{}.now());
}

}  // namespace

extern "C" ssize_t sendmsg(int socket, const msghdr* message, int flags) {
  if (held_back(message))
    return static_cast<ssize_t>(bytes_of(*message));  // as a radio would lose it
  return static_cast<ssize_t>(syscall(SYS_sendmsg, socket, message, flags));
}

namespace {
[[maybe_unused]] const bool available = maplet::WireMeter::available = true;
}

#endif
