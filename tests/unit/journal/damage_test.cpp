// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Bits that flip, files that end too early, sectors that are gone, versions.
#include <gtest/gtest.h>

#include "core/base/crc.hpp"
#include "daemon/journal/mend.hpp"
#include "tests/support/journal_model.hpp"

namespace maplet::test {
namespace {

using namespace journal;

constexpr std::uint32_t kHalfPages = 128;
constexpr std::uint32_t kTurns = 30;
constexpr Keep kKeep{};

/// kTurns turns, each of a delta-pose and a maplet.
ModelFile filled() {
  ModelFile file{2 * kHalfPages * kPageBytes};
  Journaled j{file};
  j.store.begin(Journaled::kLife, kHalfPages);
  EXPECT_TRUE(j.turn.add(Part{0, 1'700'000'000}));
  for (std::uint32_t i = 0; i < kTurns; ++i) {
    EXPECT_TRUE(j.turn.add(numbered_delta(i)));
    EXPECT_TRUE(j.turn.add({3, Journaled::kLife.epoch, i}, 0.25F, numbered_maplet(i)));
    EXPECT_TRUE(j.store.append(j.turn, kKeep));
  }
  return file;
}

TEST(Damage, AFlippedBitAnywhereIsSetRight) {
  const ModelFile good = filled();
  std::mt19937 rng{11};
  ModelFile whole = good;
  const std::uint64_t used = survey_of(whole).end;
  int mended = 0;
  for (int i = 0; i < 300; ++i) {
    ModelFile file = good;
    const std::size_t at = static_cast<std::size_t>(rng() % used);
    file.bytes()[at] ^= std::byte{1} << rng() % 8;
    const Survey survey = survey_of(file);
    const Contents found = contents_of(file);
    ASSERT_EQ(found.deltas.size(), kTurns) << at;
    for (std::uint32_t k = 0; k < kTurns; ++k) {
      ASSERT_EQ(found.deltas[k], numbered_delta(k));
      ASSERT_EQ(found.maplet_bytes[k], numbered_maplet(k));
    }
    EXPECT_EQ(survey.damage.turns, 0U);
    mended += survey.damage.mended_bits > 0 ? 1 : 0;
  }
  EXPECT_GT(mended, 100);  // the others lie between two turns
}

TEST(Damage, WhatLiesBeforeACutIsThere) {
  const ModelFile good = filled();
  std::mt19937 rng{12};
  ModelFile whole = good;
  const std::uint64_t used = survey_of(whole).end;
  for (int i = 0; i < 300; ++i) {
    ModelFile file = good;
    const std::size_t size = static_cast<std::size_t>(rng() % used);
    // Where turns end, of those that are whole.
    std::uint32_t before = 0;
    {
      Contents all;
      std::vector<std::byte> buffer(kMaxTurnBytes);
      ModelFile copy = good;
      Reader reader{copy, buffer};
      std::uint64_t at = 0;
      for (std::uint32_t k = 0; k < kTurns; ++k) {
        std::uint32_t ignored = 0;
        const auto head = read_head(
            std::span{copy.bytes()}.subspan(static_cast<std::size_t>(at), kHeadBytes), ignored);
        if (at + kHeadBytes + head->payload_bytes <= size) ++before;
        at += pages_of(head->payload_bytes) * kPageBytes;
      }
    }
    file.bytes().resize(size);
    const Survey survey = survey_of(file);
    ASSERT_EQ(contents_of(file).deltas.size(), before) << size;
    if (before > 0) {
      EXPECT_EQ(survey.damage.missing_bytes, 2U * kHalfPages * kPageBytes - size);
    }
  }
}

TEST(Damage, ALostSectorCostsItsTurnAndIsSaid) {
  const ModelFile good = filled();
  ModelFile whole = good;
  const std::uint64_t used = survey_of(whole).end;
  for (std::size_t at = 0; at + 512 <= used; at += 512) {
    ModelFile file = good;
    std::fill_n(file.bytes().begin() + static_cast<std::ptrdiff_t>(at), 512, std::byte{0xA5});
    const Survey survey = survey_of(file);
    const Contents found = contents_of(file);
    ASSERT_GE(found.deltas.size() + 1, kTurns) << at;
    if (found.deltas.size() < kTurns) {
      EXPECT_TRUE(survey.damage.turns == 1 || survey.damage.tail_bytes > 0) << at;
    }
    for (const DeltaPoseRecord& record : found.deltas)
      ASSERT_EQ(record, numbered_delta(record.key.seq));
  }
}

TEST(Damage, GoingOnBehindDamageLosesNothingMore) {
  ModelFile file = filled();
  std::fill_n(file.bytes().begin() + 5 * kPageBytes, kPageBytes, std::byte{});
  Journaled j{file};
  const Survey survey = survey_of(file);
  const std::size_t before = contents_of(file).deltas.size();
  ASSERT_TRUE(j.store.go_on(survey, kKeep));
  j.turn.know_ends(survey.ends);
  ASSERT_EQ(survey.ends[0], kTurns);
  ASSERT_TRUE(j.turn.add(numbered_delta(kTurns)));
  ASSERT_TRUE(j.store.append(j.turn, kKeep));
  EXPECT_EQ(contents_of(file).deltas.size(), before + 1);
}

TEST(Damage, ANewerVersionIsSeen) {
  ModelFile file{2 * kHalfPages * kPageBytes};
  std::vector<std::byte> turn(kHeadBytes + 10);
  seal({kVersion + 1, Journaled::kLife, 1, 0, 0, 0, 0, kHalfPages, false, {}}, turn);
  ASSERT_TRUE(file.write(0, turn));
  EXPECT_EQ(survey_of(file).state, Survey::State::kNewer);
}

TEST(Damage, AnOlderVersionIsTakenOver) {
  ModelFile file{2 * kHalfPages * kPageBytes};
  Journaled j{file};
  std::uint64_t at = 0;
  for (std::uint32_t i = 0; i < 5; ++i) {  // as version 1 wrote them: no ends in the head
    ASSERT_TRUE(j.turn.add(numbered_delta(i)));
    seal({1, Journaled::kLife, 1, i, 0, 0, 0, kHalfPages, false, {}}, j.turn.turn());
    ASSERT_TRUE(file.write(at, j.turn.turn()));
    at += pages_of(j.turn.payload_bytes()) * kPageBytes;
    j.turn.clear();
  }
  const Survey old = survey_of(file);
  EXPECT_EQ(old.version, 1);
  EXPECT_EQ(old.ends[0], 5U);
  ASSERT_TRUE(j.store.go_on(old, kKeep));
  const Survey now = survey_of(file);
  EXPECT_EQ(now.version, kVersion);
  EXPECT_EQ(now.generation, 2U);
  EXPECT_EQ(now.ends[0], 5U);
  EXPECT_EQ(contents_of(file).deltas.size(), 5U);
}

TEST(Damage, AnEmptyFileHoldsNothing) {
  ModelFile empty{0};
  EXPECT_EQ(survey_of(empty).state, Survey::State::kEmpty);
  ModelFile zeros{2 * kHalfPages * kPageBytes};
  EXPECT_EQ(survey_of(zeros).state, Survey::State::kEmpty);
  EXPECT_FALSE(survey_of(zeros).damage.any());
}

TEST(Mend, FindsEverySingleBit) {
  std::mt19937 rng{4};
  std::vector<std::byte> bytes(257);
  for (std::byte& b : bytes) b = static_cast<std::byte>(rng());
  const std::uint32_t crc = crc32c(bytes);
  EXPECT_EQ(mend(bytes, crc), Mend::kWhole);
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    auto damaged = bytes;
    damaged[bit / 8] ^= std::byte{1} << bit % 8;
    ASSERT_EQ(mend(damaged, crc), Mend::kMended);
    ASSERT_EQ(damaged, bytes);
  }
  auto two = bytes;
  two[3] ^= std::byte{1};
  two[200] ^= std::byte{4};
  EXPECT_EQ(mend(two, crc), Mend::kBroken);
}

TEST(Items, EveryKindReadsBackAsWritten) {
  std::vector<std::byte> buffer(kMaxTurnBytes);
  TurnBuilder turn{buffer, Journaled::kLife};
  const NodePose pose{{3, 9, 4}, {3, 9, 0}, Se3::exp(Vector6d::Constant(0.1))};
  const RangeRecord range{{3, 9, Stream::kRanges, 5}, {3, 9, 1}, {4, 2, 2}, Stamp{1}, 1234, 5};
  const Decision decision{{3, 9, 1}, {4, 2, 2}, true};
  ASSERT_TRUE(turn.add(Part{7, -5}));
  ASSERT_TRUE(turn.add(numbered_delta(3)));
  ASSERT_TRUE(turn.add(range));
  ASSERT_TRUE(turn.add(numbered_delta(4)));
  ASSERT_TRUE(turn.add(decision));
  ASSERT_TRUE(turn.add(Poses{99, true, {&pose, 1}}));
  ASSERT_TRUE(turn.add({3, 9, 6}, 1.0F, numbered_maplet(6)));
  Contents found;
  ASSERT_TRUE(read_items(turn.payload(), Journaled::kLife, found));
  EXPECT_EQ(found.parts.at(0), (Part{7, -5}));
  EXPECT_EQ(found.deltas.at(0), numbered_delta(3));
  EXPECT_EQ(found.deltas.at(1), numbered_delta(4));
  EXPECT_EQ(found.ranges.at(0), range);
  EXPECT_EQ(found.decisions.at(0), decision);
  EXPECT_EQ(found.poses.at(0).key, pose.key);
  EXPECT_EQ(found.poses.at(0).T_gauge_maplet.t, pose.T_gauge_maplet.t);
  EXPECT_EQ(found.maplet_bytes.at(0), numbered_maplet(6));
  EXPECT_EQ(turn.ends()[0], 5U);
}

}  // namespace
}  // namespace maplet::test
