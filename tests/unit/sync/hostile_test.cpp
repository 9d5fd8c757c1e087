// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "core/base/crc.hpp"
#include "tests/support/exchange_world.hpp"

namespace maplet::test {
namespace {

using std::chrono::seconds;

/// Datagrams of every kind, as two agents that meet send them.
std::vector<std::vector<std::byte>> real_datagrams() {
  World world{1, {}};
  Robot& a = world.add(1, 100, wifi_profile(), 4000.0);
  Robot& b = world.add(2, 200, radio_profile(), 4000.0);
  for (int i = 0; i < 20; ++i) world.make_delta(a, i % 4 == 3);
  world.make_maplet(a, 3000);
  EXPECT_TRUE(a.node.put(
      RangeRecord{{1, 100, Stream::kRanges, 0}, {1, 100, 0}, {2, 200, 0}, Stamp{5}, 1000, 10},
      world.now));
  std::vector<std::vector<std::byte>> all;
  for (int i = 0; i < 400; ++i) {
    world.now += std::chrono::milliseconds{100};
    for (auto [from, to] : {std::pair{&a, &b}, std::pair{&b, &a}}) {
      const auto out = from->node.next(world.now);
      if (out.bytes.empty()) continue;
      all.emplace_back(out.bytes.begin(), out.bytes.end());
      to->node.receive(out.bytes, world.now);
    }
  }
  return all;
}

TEST(Hostile, NoneOfAMillionDamagedDatagramsIsTaken) {
  const auto real = real_datagrams();
  ASSERT_GT(real.size(), 10U);
  World world{2, {}};
  Robot& victim = world.add(3, 300, wifi_profile(), 4000.0);
  std::mt19937 rng{3};
  std::vector<std::byte> bytes;
  for (int i = 0; i < 1'000'000; ++i) {
    if (i % 4 == 0) {  // anything at all
      bytes.resize(rng() % 200);
      for (auto& byte : bytes) byte = static_cast<std::byte>(rng());
    } else {  // a real one with bits turned over, or cut
      const auto& whole = real[rng() % real.size()];
      bytes = whole;
      const std::size_t flips = 1 + rng() % 8;
      for (std::size_t flip = 0; flip < flips; ++flip) {
        bytes[rng() % bytes.size()] ^= static_cast<std::byte>(1U << rng() % 8);
      }
      if (i % 16 == 1) bytes.resize(rng() % bytes.size());
      if (bytes == whole) bytes[0] ^= std::byte{1};  // a bit turned over twice
    }
    victim.node.receive(bytes, world.now);
  }
  const NodeCounters& counters = victim.node.counters();
  EXPECT_EQ(counters.datagrams_in, 1'000'000U);
  EXPECT_EQ(counters.damaged, 1'000'000U);
  EXPECT_TRUE(victim.node.peers().empty());
  EXPECT_TRUE(victim.taker.delta_poses.empty());
  EXPECT_EQ(victim.node.ledger().records(), 0U);
}

TEST(Hostile, IntactNonsenseIsCountedAndBoundedInTime) {
  const auto real = real_datagrams();
  World world{4, {}};
  Robot& victim = world.add(3, 300, wifi_profile(), 4000.0);
  std::mt19937 rng{5};
  for (int i = 0; i < 100'000; ++i) {  // bits turned over, checksum mended
    std::vector<std::byte> bytes = real[rng() % real.size()];
    const std::size_t body = bytes.size() - kDatagramCrcBytes;
    for (int flip = 0; flip < 3; ++flip) {
      bytes[rng() % body] ^= static_cast<std::byte>(1U << rng() % 8);
    }
    const std::uint32_t crc = crc32c(std::span{bytes}.first(body));
    for (std::size_t k = 0; k < 4; ++k) bytes[body + k] = static_cast<std::byte>(crc >> 8 * k);
    world.now += std::chrono::milliseconds{1};
    victim.node.receive(bytes, world.now);
    if (i % 10 == 0) (void)victim.node.next(world.now);
  }
  EXPECT_GT(victim.node.counters().malformed, 0U);
  for (const auto& [key, record] : victim.taker.delta_poses) EXPECT_TRUE(valid(record));
}

TEST(Hostile, ANewerVersionIsLeftAlone) {
  World world{6, {}};
  Robot& victim = world.add(3, 300, wifi_profile(), 4000.0);
  std::vector<std::byte> bytes = real_datagrams()[0];
  bytes[0] = static_cast<std::byte>(0xA2);
  const std::size_t body = bytes.size() - kDatagramCrcBytes;
  const std::uint32_t crc = crc32c(std::span{bytes}.first(body));
  for (std::size_t k = 0; k < 4; ++k) bytes[body + k] = static_cast<std::byte>(crc >> 8 * k);
  victim.node.receive(bytes, world.now);
  EXPECT_EQ(victim.node.counters().future, 1U);
  EXPECT_TRUE(victim.node.peers().empty());
}

TEST(Hostile, UnknownEntriesAreSkippedAndTheRestIsRead) {
  World world{7, {}};
  Robot& a = world.add(1, 100, wifi_profile(), 4000.0);
  const RecordKey key = world.make_delta(a);
  Robot& victim = world.add(3, 300, wifi_profile(), 4000.0);
  std::array<std::byte, 600> buffer;
  DatagramWriter out{buffer, {{1, 100}, 0}};
  const std::array<std::byte, 5> future{};
  ASSERT_TRUE(out.add(static_cast<EntryKind>(200), future));
  std::array<std::byte, kMaxRecordBytes> body;
  ByteWriter writer{body};
  RecordContext context{1, 100};
  write_record(writer, context, a.taker.delta_poses.at(key));
  ASSERT_TRUE(out.add(EntryKind::kDeltaPose, std::span{body}.first(writer.size())));
  victim.node.receive(out.finish(), world.now);
  EXPECT_EQ(victim.node.counters().unknown, 1U);
  EXPECT_EQ(victim.taker.delta_poses.size(), 1U);
}

TEST(Hostile, OversizeIsNotTaken) {
  World world{8, {}};
  Robot& victim = world.add(3, 300, wifi_profile(), 4000.0);
  victim.node.receive(std::vector<std::byte>(100'000), world.now);
  EXPECT_EQ(victim.node.counters().damaged, 1U);
}

TEST(Hostile, AKeyWithTwoContentsKeepsTheFirst) {
  World world{9, {}};
  Robot& victim = world.add(3, 300, wifi_profile(), 4000.0);
  for (std::uint32_t seed : {1U, 2U}) {
    std::mt19937 rng{seed};
    const auto record = quantise(random_delta(rng, 1, 100, 0), 1, 100, 0);
    std::array<std::byte, 600> buffer;
    DatagramWriter out{buffer, {{1, 100}, 0}};
    std::array<std::byte, kMaxRecordBytes> body;
    ByteWriter writer{body};
    RecordContext context{1, 100};
    write_record(writer, context, *record);
    ASSERT_TRUE(out.add(EntryKind::kDeltaPose, std::span{body}.first(writer.size())));
    victim.node.receive(out.finish(), world.now);
  }
  EXPECT_EQ(victim.node.counters().conflicting, 1U);
  EXPECT_EQ(victim.taker.delta_poses.size(), 1U);
}

}  // namespace
}  // namespace maplet::test
