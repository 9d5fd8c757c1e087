// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>

namespace maplet {

/// IP bytes that this process put on the radio's DDS domain, DDS's own traffic included: a domain's
/// datagrams go to its range of UDP ports. The daemon's wire_counter.cpp counts them where they
/// leave; a program without it has no meter and estimates.
struct WireMeter {
  static std::atomic<bool> available;
  static std::atomic<std::uint32_t> first_port;  ///< of the radio's domain; 0 = count nothing
  static std::atomic<std::uint64_t> bytes;
  static std::atomic<std::uint64_t> datagrams;

  static constexpr std::uint32_t kPortsOfDomain = 250;
  static constexpr std::size_t kIpUdpBytes = 28;

  static void watch_domain(int domain) noexcept {
    first_port = 7400 + kPortsOfDomain * static_cast<std::uint32_t>(domain);
  }
  static void note(std::uint32_t port, std::size_t payload) noexcept {
    const std::uint32_t first = first_port.load(std::memory_order_relaxed);
    if (first == 0 || port < first || port >= first + kPortsOfDomain) return;
    bytes.fetch_add(payload + kIpUdpBytes, std::memory_order_relaxed);
    datagrams.fetch_add(1, std::memory_order_relaxed);
  }
};

}  // namespace maplet
