// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/clock.hpp"

namespace maplet {

/// IP bytes that this process put on the radio's DDS domain, DDS's own traffic included: a domain's
/// datagrams go to its range of UDP ports. The daemon's wire_counter.cpp counts them where they
/// leave; a program without it has no meter and estimates.
///
/// And the last word on the budget: DDS repeats itself in bursts that nobody else can hold back, so
/// a datagram beyond the limit of ten seconds is not sent at all. What is lost is repeated later,
/// by DDS as by the exchange.
///
/// Threads  any
struct WireMeter {
  static std::atomic<bool> available;
  static std::atomic<std::uint32_t> first_port;  ///< of the radio's domain; 0 = count nothing
  static std::atomic<std::uint64_t> bytes;
  static std::atomic<std::uint64_t> datagrams;
  static std::atomic<std::uint64_t> held_back;         ///< datagrams
  static std::atomic<std::uint64_t> most_in_a_window;  ///< IP bytes; 0 = no limit

  static constexpr std::uint32_t kPortsOfDomain = 250;
  static constexpr std::size_t kIpUdpBytes = 28;
  static constexpr Duration kWindow = std::chrono::seconds{10};

  static void watch_domain(int domain) noexcept {
    first_port = 7400 + kPortsOfDomain * static_cast<std::uint32_t>(domain);
  }
  [[nodiscard]] static bool watched(std::uint32_t port) noexcept {
    const std::uint32_t first = first_port.load(std::memory_order_relaxed);
    return first != 0 && port >= first && port < first + kPortsOfDomain;
  }
  /// @param head  its first bytes: introductions to strangers have a pace (HandshakePace) and,
  /// where
  ///   there is a limit, half of it
  /// @return whether a datagram may go; counted as sent, or as held back
  [[nodiscard]] static bool pass(std::span<const std::byte> head, std::size_t payload,
                                 Instant now) noexcept;
  [[nodiscard]] static bool pass(std::size_t payload, Instant now) noexcept;
};

}  // namespace maplet
