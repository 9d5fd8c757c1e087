// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The store against a disk that loses its power at any moment.
#include <gtest/gtest.h>

#include "tests/support/journal_model.hpp"

namespace maplet::test {
namespace {

using namespace journal;

constexpr std::uint32_t kHalfPages = 64;
constexpr Keep kKeep{8, 40'000, 1'000'000};

/// Turns of a delta-pose and a maplet each; knows what was acknowledged.
class Robot {
 public:
  explicit Robot(ModelFile& file) : file_{file} {}

  /// Starts again on what is there. @return what was found
  Contents start() {
    journaled_ = std::make_unique<Journaled>(file_);
    const Survey survey = survey_of(file_);
    const Contents found = contents_of(file_);
    if (survey.state == Survey::State::kGood) {
      EXPECT_TRUE(journaled_->store.go_on(survey, kKeep));
      journaled_->turn.know_ends(survey.ends);
      next_ = survey.ends[0];
      EXPECT_EQ(survey.damage.turns, 0U);
    } else {
      journaled_->store.begin(Journaled::kLife, kHalfPages);
      next_ = 0;
    }
    acknowledged_ = next_;
    return found;
  }
  /// @return false when the power went
  bool work(std::mt19937& rng) {
    TurnBuilder& turn = journaled_->turn;
    const std::uint32_t count = 1 + rng() % 4;
    for (std::uint32_t i = 0; i < count; ++i) {
      EXPECT_TRUE(turn.add(numbered_delta(next_)));
      EXPECT_TRUE(turn.add({Journaled::kLife.agent, Journaled::kLife.epoch, next_}, 0.5F,
                           numbered_maplet(next_)));
      ++next_;
    }
    if (!journaled_->store.append(turn, kKeep)) return false;
    acknowledged_ = next_;
    return true;
  }
  [[nodiscard]] std::uint32_t acknowledged() const { return acknowledged_; }
  [[nodiscard]] std::uint32_t tried() const { return next_; }
  [[nodiscard]] const Store& store() const { return journaled_->store; }

 private:
  ModelFile& file_;
  std::unique_ptr<Journaled> journaled_;
  std::uint32_t next_ = 0;
  std::uint32_t acknowledged_ = 0;
};

/// All delta-poses up to at least `acknowledged` without a gap, none beyond `tried`; of the maplets
/// the newest; each as it was written.
void expect_sound(const Contents& found, std::uint32_t acknowledged, std::uint32_t tried) {
  ASSERT_GE(found.deltas.size(), acknowledged);
  ASSERT_LE(found.deltas.size(), tried);
  for (std::uint32_t i = 0; i < found.deltas.size(); ++i)
    ASSERT_EQ(found.deltas[i], numbered_delta(i)) << i;
  if (acknowledged > 0) {
    ASSERT_GE(found.maplets.size(), 1U);
  }
  const auto first = static_cast<std::uint32_t>(found.deltas.size() - found.maplets.size());
  for (std::uint32_t i = 0; i < found.maplets.size(); ++i) {
    ASSERT_EQ(found.maplets[i].id, first + i);
    ASSERT_EQ(found.maplet_bytes[i], numbered_maplet(first + i));
  }
}

TEST(StoreModel, NothingAcknowledgedIsLostWhateverThePowerCutLeaves) {
  std::uint32_t changes = 0;
  for (std::uint32_t seed = 0; seed < 24; ++seed) {
    std::mt19937 rng{seed};
    ModelFile file{2 * kHalfPages * kPageBytes};
    Robot robot{file};
    robot.start();
    for (int life = 0; life < 12; ++life) {
      file.stop_after(1 + rng() % 60);
      while (robot.work(rng)) {
      }
      changes += robot.store().generation() > 1 ? 1 : 0;
      const std::uint32_t acknowledged = robot.acknowledged();
      const std::uint32_t tried = robot.tried();
      file.lose_power(rng);
      expect_sound(robot.start(), acknowledged, tried);
      if (HasFatalFailure()) FAIL() << "seed " << seed << ", life " << life;
    }
  }
  EXPECT_GT(changes, 40U) << "the halves must change under the power cuts, too";
}

TEST(StoreModel, EveryPrefixOfEveryWriteIsSound) {
  // A change of halves in the middle: few pages a half.
  for (std::uint64_t operations = 1; operations < 140; operations += 5) {
    std::mt19937 rng{5};
    ModelFile once{2 * kHalfPages * kPageBytes};
    Robot robot{once};
    robot.start();
    once.stop_after(operations);
    while (robot.work(rng)) {
    }
    const std::size_t most = once.unsafe_bytes();
    for (std::size_t bytes = 0; bytes <= most; bytes += 1 + most / 8) {
      ModelFile file = once;
      file.lose_power_after(bytes);
      Robot again{file};
      expect_sound(again.start(), robot.acknowledged(), robot.tried());
      if (HasFatalFailure()) FAIL() << operations << " operations, " << bytes << " bytes";
    }
  }
}

TEST(StoreModel, EveryByteOfOneWriteMayBeTheLast) {
  ModelFile once{2 * kHalfPages * kPageBytes};
  std::mt19937 rng{1};
  Robot robot{once};
  robot.start();
  ASSERT_TRUE(robot.work(rng));
  once.stop_after(1);  // the next turn is written, but not flushed
  EXPECT_FALSE(robot.work(rng));
  ModelFile file = once;
  for (std::size_t bytes = 0; bytes <= once.unsafe_bytes(); bytes += bytes < 200 ? 1 : 7) {
    file = once;
    file.lose_power_after(bytes);
    const Survey survey = survey_of(file);
    ASSERT_EQ(survey.ends[0], bytes < once.unsafe_bytes() ? robot.acknowledged() : robot.tried())
        << bytes;
  }
}

TEST(StoreModel, AHalfThatIsFullGivesWayAndCarriesWhatCounts) {
  ModelFile file{2 * kHalfPages * kPageBytes};
  std::mt19937 rng{3};
  Robot robot{file};
  robot.start();
  while (robot.store().generation() < 6) ASSERT_TRUE(robot.work(rng));
  const Contents all = contents_of(file);
  expect_sound(all, robot.acknowledged(), robot.tried());
  EXPECT_GT(robot.store().bytes_carried(), 0U);
}

}  // namespace
}  // namespace maplet::test
