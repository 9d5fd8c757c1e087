// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/flight_log.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "tests/support/journal_model.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet::test {
namespace {

using daemon::FlightLog;
using daemon::FlightWriter;

constexpr int kWidth = 32;
constexpr int kHeight = 24;
constexpr ImageSize kRoom{64, 48};

/// A frame of its own pixels, the same ones for the same number.
struct Picture {
  explicit Picture(std::uint16_t number) : depth(kWidth * kHeight), gray(kWidth * kHeight) {
    for (std::size_t i = 0; i < depth.size(); ++i) {
      depth[i] = static_cast<std::uint16_t>(i % 7 == 0 ? 0 : 1000 + number + i % 13);
      gray[i] = static_cast<std::uint8_t>(i + number);
    }
  }
  [[nodiscard]] DepthFrame frame(std::uint64_t index) const {
    DepthFrame f;
    f.index = index;
    f.stamp = Stamp{static_cast<std::int64_t>(index) * 33'000'000};
    f.depth = {depth.data(), kWidth, kHeight, kWidth};
    f.camera = {kWidth, kHeight, 28.0, 28.0, 15.5, 11.5};
    f.gray = {gray.data(), kWidth, kHeight, kWidth};
    return f;
  }
  std::vector<std::uint16_t> depth;
  std::vector<std::uint8_t> gray;
};

class Flights : public testing::Test {
 protected:
  [[nodiscard]] std::string path() const { return (folder_.path() / "flight").string(); }

  template <class Fly>
  void record(Fly&& fly) {
    auto ring = flight::RingWriter::make(path(), 1 << 20);
    ASSERT_TRUE(ring);
    ASSERT_TRUE((*ring)->put(flight::Block::kHead, std::as_bytes(std::span{"{}", 2})));
    FlightLog log;
    log.record(std::make_unique<FlightWriter>(std::move(*ring), path(), 1 << 20), true,
               kWidth * kHeight);
    fly(log);
    log.note_stop({3, 1, 1, 0});
    log.flush();
  }
  void replay(FlightLog& log, ImageSize room = kRoom) {
    auto reader = flight::RingReader::open(path());
    ASSERT_TRUE(reader);
    log.replay(std::move(*reader), room);
  }
  static Expected<DepthFrame> none() { return fail(ErrorCode::kEnd, "nobody asks"); }

  TempDir folder_;
};

TEST_F(Flights, EverythingComesAgainAsItCame) {
  const Picture first{1};
  const Picture second{2};
  const std::vector<std::byte> maplet = numbered_maplet(9);
  const MapletKey key{4, 5, 6};
  std::vector<Instant> clock;
  record([&](FlightLog& log) {
    clock.push_back(log.now());
    log.note(numbered_delta(1));
    log.note(key, maplet);
    log.note_restored({1, 2, 3, 4});
    (void)log.frame([&]() -> Expected<DepthFrame> { return first.frame(0); });
    clock.push_back(log.now());
    EXPECT_EQ(log.budget(Duration{7}), Duration{7});
    EXPECT_TRUE(log.flag(true));
    (void)log.frame([&]() -> Expected<DepthFrame> { return fail(ErrorCode::kTimeout, "late"); });
    (void)log.frame([&]() -> Expected<DepthFrame> { return second.frame(2); });
    clock.push_back(log.now());
  });
  FlightLog log;
  replay(log);
  EXPECT_EQ(log.now(), clock[0]);
  DeltaPoseRecord delta;
  ASSERT_TRUE(log.replayed(delta));
  EXPECT_EQ(delta, numbered_delta(1));
  std::vector<std::byte> bytes(kMaxMapletBytes);
  MapletKey again;
  ASSERT_EQ(log.replayed_maplet(again, bytes), maplet.size());
  EXPECT_EQ(again, key);
  EXPECT_TRUE(std::ranges::equal(maplet, std::span{bytes}.first(maplet.size())));
  std::array<std::uint32_t, kStreams> ends{};
  ASSERT_TRUE(log.replayed_restored(ends));
  EXPECT_EQ(ends, (std::array<std::uint32_t, kStreams>{1, 2, 3, 4}));
  const auto a = log.frame(none);
  ASSERT_TRUE(a);
  EXPECT_TRUE(std::ranges::equal(std::span{a->depth.pixels, first.depth.size()}, first.depth));
  EXPECT_TRUE(std::ranges::equal(std::span{a->gray.pixels, first.gray.size()}, first.gray));
  EXPECT_EQ(log.now(), clock[1]);
  EXPECT_EQ(log.budget(Duration{99}), Duration{7});
  EXPECT_TRUE(log.flag(false));
  EXPECT_EQ(log.frame(none).error().code, ErrorCode::kTimeout);
  const auto b = log.frame(none);
  ASSERT_TRUE(b);
  EXPECT_EQ(b->index, 2U);
  EXPECT_EQ(log.now(), clock[2]);
  EXPECT_TRUE(log.over());
  SourceCounters counters;
  log.replayed_stop(counters);
  EXPECT_EQ(counters.read, 3U);
  EXPECT_FALSE(log.damaged());
}

TEST_F(Flights, WhatWasNotAskedThenGetsTheLastTimeKnown) {
  const Picture picture{1};
  Instant then;
  record([&](FlightLog& log) {
    then = log.now();
    (void)log.frame([&]() -> Expected<DepthFrame> { return picture.frame(0); });
  });
  FlightLog log;
  replay(log);
  EXPECT_EQ(log.now(), then);
  EXPECT_EQ(log.now(), then);
  EXPECT_FALSE(log.flag(true));
  for (int round = 0; round < 10 && !log.over(); ++round)
    log.keep_going();  // nobody takes the frame
  EXPECT_TRUE(log.over());
}

TEST_F(Flights, EndsWhereABlockIsDamaged) {
  const Picture picture{1};
  record([&](FlightLog& log) {
    for (std::uint64_t i = 0; i < 3; ++i)
      (void)log.frame([&]() -> Expected<DepthFrame> { return picture.frame(i); });
  });
  const auto size = std::filesystem::file_size(path());
  std::size_t ended_early = 0;
  for (std::uint64_t at = 64; at < size; at += 61) {
    const std::string whole = read_bytes(path());
    std::string bytes = whole;
    const auto flipped = static_cast<std::size_t>(at);
    bytes[flipped] = static_cast<char>(bytes[flipped] ^ 0x10);
    write_bytes(path(), bytes);
    if (auto reader = flight::RingReader::open(path())) {
      FlightLog log;
      log.replay(std::move(*reader), kRoom);
      for (std::uint64_t i = 0; !log.over(); ++i) {
        const auto frame = log.frame(none);
        if (!frame) break;
        // Frames that come are whole. Where a head is gone, what stands before it is left out.
        EXPECT_TRUE(std::ranges::equal(std::span{frame->depth.pixels, picture.depth.size()},
                                       picture.depth));
      }
      ended_early += log.damaged() ? 1 : 0;
    }
    write_bytes(path(), whole);
  }
  EXPECT_GT(ended_early, 10U);
}

TEST_F(Flights, AFrameThatIsLargerThanThereIsRoomForIsDamage) {
  const Picture picture{1};
  record([&](FlightLog& log) {
    (void)log.frame([&]() -> Expected<DepthFrame> { return picture.frame(0); });
  });
  FlightLog log;
  replay(log, {kWidth / 2, kHeight});
  EXPECT_FALSE(log.frame(none));
  EXPECT_TRUE(log.damaged());
  EXPECT_TRUE(log.over());
}

}  // namespace
}  // namespace maplet::test
