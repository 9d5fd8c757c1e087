// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/autopilot_address.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/un.h>

#include <charconv>
#include <cstddef>
#include <cstring>
#include <string_view>

namespace maplet::daemon {

namespace {

tl::unexpected<std::string> bad(const std::string& text, std::string_view why) {
  return tl::unexpected{fmt::format(
      "'{}': {}: must be udp:ADDRESS:PORT, as udp:127.0.0.1:14600, or unix:PATH", text, why)};
}

DatagramAddress unix_address(std::string_view path) {
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  std::memcpy(to.sun_path, path.data(), path.size());
  const bool abstract = path.front() == '@';
  if (abstract) to.sun_path[0] = '\0';
  DatagramAddress out;
  out.size =
      static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size() + (abstract ? 0U : 1U));
  std::memcpy(&out.address, &to, sizeof to);
  return out;
}

}  // namespace

tl::expected<DatagramAddress, std::string> DatagramAddress::parse(const std::string& text) {
  std::string_view rest = text;
  if (rest.starts_with("unix:")) {
    rest.remove_prefix(5);
    if (rest.empty()) return bad(text, "no path");
    if (rest.size() >= sizeof(sockaddr_un::sun_path)) return bad(text, "the path is too long");
    return unix_address(rest);
  }
  if (!rest.starts_with("udp:")) return bad(text, "neither udp: nor unix:");
  rest.remove_prefix(4);
  const std::size_t colon = rest.rfind(':');
  if (colon == std::string_view::npos) return bad(text, "no port");
  std::uint16_t port = 0;
  const std::string_view digits = rest.substr(colon + 1);
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  if (error != std::errc{} || end != digits.data() + digits.size() || port == 0)
    return bad(text, "the port is no number of 1 to 65535");
  std::string host{rest.substr(0, colon)};
  DatagramAddress out;
  sockaddr_in v4{};
  sockaddr_in6 v6{};
  if (inet_pton(AF_INET, host.c_str(), &v4.sin_addr) == 1) {
    v4.sin_family = AF_INET;
    v4.sin_port = htons(port);
    out.size = sizeof v4;
    std::memcpy(&out.address, &v4, sizeof v4);
    return out;
  }
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  if (inet_pton(AF_INET6, host.c_str(), &v6.sin6_addr) != 1)
    return bad(text, "the address is none in numbers");
  v6.sin6_family = AF_INET6;
  v6.sin6_port = htons(port);
  out.size = sizeof v6;
  std::memcpy(&out.address, &v6, sizeof v6);
  return out;
}

}  // namespace maplet::daemon
