// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Linked into the program itself, not into the library: it stands before libc's sendmsg(), through
// which Cyclone sends everything, counts for WireMeter, and holds back what goes beyond its limit.
#ifndef MAPLET_SANITIZED

#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <span>

#include "transport/dds/wire_meter.hpp"

namespace {

std::size_t bytes_of(const msghdr& message) noexcept {
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < message.msg_iovlen; ++i) bytes += message.msg_iov[i].iov_len;
  return bytes;
}

std::span<const std::byte> head_of(const msghdr& message, std::span<std::byte> place) noexcept {
  std::size_t size = 0;
  for (std::size_t i = 0; i < message.msg_iovlen && size < place.size(); ++i) {
    const iovec& part = message.msg_iov[i];
    const std::size_t bytes = std::min(part.iov_len, place.size() - size);
    std::copy_n(static_cast<const std::byte*>(part.iov_base), bytes, place.data() + size);
    size += bytes;
  }
  return place.first(size);
}

/// Whether it is the radio's, and over its limit.
bool held_back(const msghdr* message) noexcept {
  if (message == nullptr || message->msg_name == nullptr) return false;
  const auto* address = static_cast<const sockaddr*>(message->msg_name);
  if (address->sa_family != AF_INET) return false;
  const auto* to = static_cast<const sockaddr_in*>(message->msg_name);
  if (!maplet::WireMeter::watched(ntohs(to->sin_port))) return false;
  std::array<std::byte, 64> head;
  return !maplet::WireMeter::pass(head_of(*message, head), bytes_of(*message),
                                  maplet::MonotonicClock{}.now());
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
