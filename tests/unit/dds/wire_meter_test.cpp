// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/wire_meter.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <random>

namespace maplet {
namespace {

using namespace std::chrono_literals;

TEST(WireMeter, NoTenSecondsCarryMoreThanTheLimit) {
  constexpr std::uint64_t kMost = 3000;
  WireMeter::most_in_a_window = kMost;
  std::mt19937 random{5};
  std::deque<std::pair<Instant, std::uint64_t>> sent;
  Instant now{100s};
  std::uint64_t total = 0;
  for (int k = 0; k < 20000; ++k) {
    now += std::chrono::milliseconds{random() % (k % 1000 < 900 ? 50 : 3000)};
    const std::size_t payload = 40 + random() % 1200;
    if (!WireMeter::pass(payload, now)) continue;
    sent.emplace_back(now, payload + WireMeter::kIpUdpBytes);
    total += sent.back().second;
    while (sent.front().first <= now - WireMeter::kWindow) {
      total -= sent.front().second;
      sent.pop_front();
    }
    ASSERT_LE(total, kMost);
  }
  EXPECT_GT(WireMeter::bytes, 200u * static_cast<unsigned>((now - Instant{100s}) / 1s));
  EXPECT_GT(WireMeter::held_back, 0u);
  WireMeter::most_in_a_window = 0;
  EXPECT_TRUE(WireMeter::pass(100000, now));
}

TEST(WireMeter, CountsTheRadiosPortsOnly) {
  WireMeter::watch_domain(3);
  EXPECT_TRUE(WireMeter::watched(7400 + 3 * 250 + 10));
  EXPECT_FALSE(WireMeter::watched(7400 + 2 * 250 + 10));
  WireMeter::first_port = 0;
  EXPECT_FALSE(WireMeter::watched(0));
}

}  // namespace
}  // namespace maplet
