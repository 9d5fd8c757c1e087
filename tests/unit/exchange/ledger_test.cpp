// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/ledger.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <vector>

namespace maplet {
namespace {

TEST(SeqSet, AgreesWithOrdinarySet) {
  std::mt19937 rng{1};
  for (int round = 0; round < 200; ++round) {
    SeqSet seqs;
    std::set<std::uint32_t> truth;
    for (int i = 0; i < 300; ++i) {
      const auto seq = static_cast<std::uint32_t>(rng() % 60);
      switch (seqs.insert(seq)) {
        case Insert::kNew:
          EXPECT_TRUE(truth.insert(seq).second);
          break;
        case Insert::kDuplicate:
          EXPECT_TRUE(truth.contains(seq));
          break;
        case Insert::kFull:
          EXPECT_FALSE(truth.contains(seq));
          EXPECT_EQ(seqs.islands().size(), SeqSet::kIslands);
          break;
      }
      std::set<std::uint32_t> gaps;
      seqs.missing({5, 50}, [&](const SeqRange& gap) {
        EXPECT_LT(gap.first, gap.end);
        for (std::uint32_t s = gap.first; s < gap.end; ++s) gaps.insert(s);
      });
      for (std::uint32_t s = 0; s < 60; ++s) {
        EXPECT_EQ(seqs.contains(s), truth.contains(s));
        EXPECT_EQ(gaps.contains(s), s >= 5 && s < 50 && !truth.contains(s));
      }
    }
  }
}

TEST(SeqSet, RefusedNumbersFitOnceGapsClose) {
  SeqSet seqs;
  for (std::uint32_t i = 0; i < SeqSet::kIslands; ++i) {
    EXPECT_EQ(seqs.insert(2 * i + 1), Insert::kNew);
  }
  const std::uint32_t refused = 2 * SeqSet::kIslands + 1;
  EXPECT_EQ(seqs.insert(refused), Insert::kFull);
  EXPECT_EQ(seqs.insert(0), Insert::kNew);
  EXPECT_EQ(seqs.next(), 2U);
  EXPECT_EQ(seqs.insert(refused), Insert::kNew);
}

TEST(SeqSet, LastNumberDoesNotExist) {
  SeqSet seqs;
  EXPECT_EQ(seqs.insert(SeqSet::kSeqEnd), Insert::kFull);
  EXPECT_EQ(seqs.insert(SeqSet::kSeqEnd - 1), Insert::kNew);
  EXPECT_EQ(seqs.end(), SeqSet::kSeqEnd);
}

TEST(Ledger, OrderAndRepetitionDoNotMatter) {
  std::vector<RecordKey> keys;
  for (std::uint16_t agent = 0; agent < 4; ++agent) {
    for (std::uint32_t seq = 0; seq < 6; ++seq) {
      keys.push_back({agent, 10U + agent % 2, Stream::kDeltaPoses, seq});
      keys.push_back({agent, 77, Stream::kClosures, seq});
    }
  }
  std::mt19937 rng{2};
  std::uint64_t digest = 0;
  for (int round = 0; round < 20; ++round) {
    Arena arena{std::size_t{1} << 20};
    Ledger ledger{{}, {}, arena};
    std::shuffle(keys.begin(), keys.end(), rng);
    for (const auto& key : keys) EXPECT_EQ(ledger.insert(key), Insert::kNew);
    for (const auto& key : keys) EXPECT_EQ(ledger.insert(key), Insert::kDuplicate);
    EXPECT_EQ(ledger.records(), keys.size());
    EXPECT_EQ(ledger.missing(), 0U);
    if (round == 0) digest = ledger.records_digest();
    EXPECT_EQ(ledger.records_digest(), digest);
  }
}

TEST(Ledger, EveryFieldOfKeyCounts) {
  std::set<std::uint64_t> digests;
  const RecordKey base{1, 2, Stream::kDeltaPoses, 3};
  for (RecordKey key :
       {base, RecordKey{2, 2, Stream::kDeltaPoses, 3}, RecordKey{1, 3, Stream::kDeltaPoses, 3},
        RecordKey{1, 2, Stream::kClosures, 3}, RecordKey{1, 2, Stream::kDeltaPoses, 4}}) {
    Arena arena{std::size_t{1} << 20};
    Ledger ledger{{}, {}, arena};
    EXPECT_EQ(ledger.insert(key), Insert::kNew);
    EXPECT_TRUE(ledger.contains(key));
    EXPECT_EQ(ledger.contains(base), key == base);
    digests.insert(ledger.records_digest());
  }
  EXPECT_EQ(digests.size(), 5U);
}

TEST(Ledger, FullOfLivesRefusesAndCountsButNotItself) {
  Arena arena{std::size_t{1} << 20};
  Ledger ledger{{.max_lives = 3}, {9, 1}, arena};
  EXPECT_EQ(ledger.insert({1, 1, Stream::kDeltaPoses, 0}), Insert::kNew);
  EXPECT_EQ(ledger.insert({2, 1, Stream::kDeltaPoses, 0}), Insert::kNew);
  EXPECT_EQ(ledger.insert({3, 1, Stream::kDeltaPoses, 0}), Insert::kFull);
  EXPECT_EQ(ledger.insert({2, 1, Stream::kDeltaPoses, 1}), Insert::kNew);
  EXPECT_FALSE(ledger.accepts({3, 1, Stream::kDeltaPoses, 0}));
  EXPECT_EQ(ledger.refused(), 1U);
  EXPECT_EQ(ledger.lives_refused(), 1U);
  EXPECT_EQ(ledger.insert({9, 1, Stream::kDeltaPoses, 0}), Insert::kNew);
  EXPECT_EQ(ledger.records(), 4U);
}

TEST(Ledger, KnowsWhatItMisses) {
  Arena arena{std::size_t{1} << 20};
  Ledger ledger{{}, {}, arena};
  ledger.expect({1, 1}, Stream::kDeltaPoses, 10);
  EXPECT_EQ(ledger.missing(), 10U);
  EXPECT_EQ(ledger.insert({1, 1, Stream::kDeltaPoses, 4}), Insert::kNew);
  EXPECT_EQ(ledger.missing(), 9U);
  EXPECT_EQ(ledger.insert({1, 1, Stream::kDeltaPoses, 12}), Insert::kNew);
  EXPECT_EQ(ledger.missing(), 11U);
}

}  // namespace
}  // namespace maplet
