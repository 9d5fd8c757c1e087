// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/digest.hpp"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <random>
#include <vector>

namespace maplet {
namespace {

struct Side {
  Arena arena{std::size_t{1} << 22};
  Ledger ledger{{.max_lives = 64}, {}, arena};
};

void insert(Ledger& ledger, const KeyRange& range) {
  for (std::uint32_t seq = range.seqs.first; seq < range.seqs.end; ++seq) {
    (void)ledger.insert({range.life.agent, range.life.epoch, range.stream, seq});
  }
}

/// `from` tells `to` all it holds, in datagrams of `bytes`; `to` then has what it lacked, and
/// `from` what it was seen to lack.
/// @return bytes of the digests
std::size_t meet(Ledger& from, Ledger& to, std::size_t bytes) {
  std::vector<std::byte> buffer(bytes);
  std::optional<Life> after;
  std::size_t total = 0;
  do {
    std::size_t written = 0;
    after = write_digest(from, after, buffer, written);
    total += written;
    const auto difference = read_digest({buffer.data(), written}, to);
    EXPECT_TRUE(difference) << difference.error().what;
    if (!difference) return total;
    for (const auto& range : difference->i_lack) insert(to, range);
    for (const auto& range : difference->they_lack) insert(from, range);
  } while (after);
  return total;
}

void fill(Ledger& ledger, std::mt19937& rng, int lives) {
  for (int i = 0; i < lives; ++i) {
    const auto agent = static_cast<std::uint16_t>(rng() % 20);
    const std::uint32_t epoch = 100 + agent % 3;
    const auto stream = static_cast<Stream>(rng() % kStreams);
    insert(ledger, {{agent, epoch}, stream, {0, static_cast<std::uint32_t>(rng() % 50)}});
    const std::uint32_t island = static_cast<std::uint32_t>(60 + rng() % 100);
    insert(ledger, {{agent, epoch}, stream, {island, island + 3}});
  }
}

TEST(Digest, TwoSidesAgreeAfterMeeting) {
  std::mt19937 rng{1};
  for (int round = 0; round < 100; ++round) {
    Side a;
    Side b;
    fill(a.ledger, rng, 12);
    fill(b.ledger, rng, 12);
    // Again: a list of 64 entries may leave some out.
    for (int i = 0; i < 3; ++i) meet(a.ledger, b.ledger, i % 2 == 0 ? 400 : 1000);
    EXPECT_EQ(a.ledger.records_digest(), b.ledger.records_digest());
    EXPECT_EQ(a.ledger.records(), b.ledger.records());
    // What is in nobody's hands (fill() leaves gaps) both know to be missing.
    EXPECT_EQ(a.ledger.missing(), b.ledger.missing());
  }
}

TEST(Digest, RelaysThroughThird) {
  Side a;
  Side b;
  Side c;
  std::mt19937 rng{2};
  fill(a.ledger, rng, 10);
  for (int i = 0; i < 3; ++i) {
    meet(a.ledger, b.ledger, 1000);
    meet(b.ledger, c.ledger, 1000);
  }
  EXPECT_GT(a.ledger.records(), 0U);
  EXPECT_EQ(c.ledger.records_digest(), a.ledger.records_digest());
}

TEST(Digest, SaysOnlyTheDifference) {
  Side a;
  Side b;
  insert(a.ledger, {{1, 5}, Stream::kDeltaPoses, {0, 10}});
  insert(b.ledger, {{1, 5}, Stream::kDeltaPoses, {0, 4}});
  insert(b.ledger, {{1, 5}, Stream::kDeltaPoses, {12, 13}});
  insert(b.ledger, {{2, 6}, Stream::kClosures, {0, 2}});
  std::array<std::byte, 512> bytes;
  std::size_t written = 0;
  EXPECT_FALSE(write_digest(a.ledger, {}, bytes, written));
  EXPECT_LE(written, 12U);  // compact: one life, one stream
  const auto difference = read_digest({bytes.data(), written}, b.ledger);
  ASSERT_TRUE(difference);
  ASSERT_EQ(difference->i_lack.size(), 1U);
  EXPECT_EQ(difference->i_lack[0], (KeyRange{{1, 5}, Stream::kDeltaPoses, {4, 10}}));
  ASSERT_EQ(difference->they_lack.size(), 2U);
  EXPECT_EQ(difference->they_lack[0], (KeyRange{{1, 5}, Stream::kDeltaPoses, {12, 13}}));
  EXPECT_EQ(difference->they_lack[1], (KeyRange{{2, 6}, Stream::kClosures, {0, 2}}));
}

TEST(Digest, SurvivesAnyBytes) {
  std::mt19937 rng{3};
  Side good;
  fill(good.ledger, rng, 12);
  std::vector<std::byte> bytes(2000);
  std::size_t written = 0;
  EXPECT_FALSE(write_digest(good.ledger, {}, bytes, written));
  for (int i = 0; i < 20000; ++i) {
    Side mine;
    std::vector<std::byte> damaged(bytes.begin(), bytes.begin() + rng() % (written + 1));
    for (int k = 0; k < 3 && !damaged.empty(); ++k) {
      damaged[rng() % damaged.size()] = static_cast<std::byte>(rng());
    }
    const auto difference = read_digest(damaged, mine.ledger);
    if (!difference) continue;
    for (const auto& range : difference->i_lack) EXPECT_LT(range.seqs.first, range.seqs.end);
    EXPECT_EQ(mine.ledger.records(), 0U);  // a digest is hearsay
  }
}

TEST(Ranges, RoundTripAndRefusal) {
  const std::vector<KeyRange> ranges{{{1, 4000000000U}, Stream::kMaplets, {0, 1}},
                                     {{65535, 0}, Stream::kDeltaPoses, {7, SeqSet::kSeqEnd}}};
  std::array<std::byte, 64> bytes;
  std::size_t written = 0;
  EXPECT_EQ(write_ranges(ranges, bytes, written), 2U);
  const auto back = read_ranges({bytes.data(), written});
  ASSERT_TRUE(back);
  ASSERT_EQ(back->size(), 2U);
  EXPECT_EQ((*back)[0], ranges[0]);
  EXPECT_EQ((*back)[1], ranges[1]);
  EXPECT_FALSE(read_ranges({bytes.data(), written - 1}));
  EXPECT_EQ(write_ranges(ranges, {bytes.data(), 12}, written), 1U);  // the second does not fit
}

}  // namespace
}  // namespace maplet
