// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/state_directory.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "daemon/clear_mission.hpp"
#include "daemon/options.hpp"
#include "daemon/private_tmp.hpp"
#include "daemon/run_setup.hpp"
#include "tests/support/journal_model.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet::test {
namespace {

namespace fs = std::filesystem;
using namespace daemon;
using Mode = StateDirectory::Mode;
using Place = journal::BlockFile::Place;

constexpr std::uint64_t kBytes = 1 << 20;

struct Folder {
  TempDir temp;
  std::string path = (temp.path() / "state").string();
  std::string mission = path + "/" + kMissionFile;

  [[nodiscard]] auto open() const {
    return StateDirectory::open(path, Journaled::kLife.agent, kBytes);
  }
  /// A mission with one record in it. @return whether all went well
  [[nodiscard]] bool fill() const {
    auto state = open();
    if (!state || state->mode() != Mode::kJournal) return false;
    Journaled j{*state->file()};
    j.store.begin(Journaled::kLife, state->survey().half_pages);
    return j.turn.add(numbered_delta(0)) && j.store.append(j.turn, {});
  }
};

void write(const std::string& file, const std::string& text) { std::ofstream{file} << text; }

std::string content(const std::string& file) {
  std::ifstream in{file};
  return {std::istreambuf_iterator<char>{in}, {}};
}

TEST(StateDirectory, TwoAtOnceAreRefusedWithOrWithoutTheLockFile) {
  const Folder f;
  auto first = f.open();
  ASSERT_TRUE(first);
  EXPECT_FALSE(f.open());
  fs::remove(f.path + "/lock");
  const auto second = f.open();
  ASSERT_FALSE(second);
  EXPECT_FALSE(second.error().usage);
  EXPECT_NE(second.error().what.find("another mapletd"), std::string::npos);
}

TEST(StateDirectory, ALinkInPlaceOfTheLockIsNotFollowed) {
  const Folder f;
  ASSERT_TRUE(f.fill());
  const std::string precious = (f.temp.path() / "precious").string();
  write(precious, "precious");
  fs::remove(f.path + "/lock");
  fs::create_symlink(precious, f.path + "/lock");
  const auto state = f.open();
  ASSERT_TRUE(state);
  EXPECT_EQ(state->mode(), Mode::kReadOnly);  // shown, and left
  EXPECT_TRUE(state->holds_mission());
  EXPECT_NE(state->problem().find("lock"), std::string::npos);
  EXPECT_EQ(content(precious), "precious");
}

TEST(StateDirectory, WhatIsNoFileIsMemoryAloneAndHoldsNobodyUp) {
  const Folder f;
  fs::create_directories(f.path);
  ASSERT_EQ(mkfifo(f.mission.c_str(), 0600), 0);
  auto state = f.open();
  ASSERT_TRUE(state);
  EXPECT_EQ(state->mode(), Mode::kMemory);
  EXPECT_TRUE(fs::is_fifo(f.mission));
  state = tl::unexpected{StateDirectory::Refusal{}};  // closed
  fs::remove(f.mission);
  fs::create_directory(f.mission);
  const auto again = f.open();
  ASSERT_TRUE(again);
  EXPECT_EQ(again->mode(), Mode::kMemory);
  EXPECT_NE(again->problem().find("directory"), std::string::npos);
}

TEST(StateDirectory, EveryDamagedStoreIsKept) {
  const Folder f;
  fs::create_directories(f.path);
  for (const char* text : {"first", "second", "third"}) {
    fs::remove(f.mission);
    write(f.mission, text);
    const auto state = f.open();
    ASSERT_TRUE(state);
    EXPECT_EQ(state->mode(), Mode::kJournal);
    ASSERT_EQ(state->said().size(), 1U);
  }
  EXPECT_EQ(content(f.mission + ".damaged"), "first");
  EXPECT_EQ(content(f.mission + ".damaged.2"), "second");
  EXPECT_EQ(content(f.mission + ".damaged.3"), "third");
}

TEST(StateDirectory, AFileKnowsWhetherALaterStartFindsIt) {
  const Folder f;
  auto state = f.open();
  ASSERT_TRUE(state);
  EXPECT_EQ(state->file()->place(), Place::kThere);
  fs::rename(f.path, f.path + ".away");
  EXPECT_EQ(state->file()->place(), Place::kElsewhere);
  fs::create_directory(f.path);
  EXPECT_EQ(state->file()->place(), Place::kElsewhere);
  write(f.mission, "another one");
  EXPECT_EQ(state->file()->place(), Place::kElsewhere);
  fs::remove_all(f.path);
  fs::rename(f.path + ".away", f.path);
  EXPECT_EQ(state->file()->place(), Place::kThere);
  fs::remove_all(f.path);
  EXPECT_EQ(state->file()->place(), Place::kRemoved);
}

TEST(ClearMission, IsDoneAtOnceOrAtTheNextStart) {
  const Folder f;
  ASSERT_TRUE(f.fill());
  {
    const auto running = f.open();
    ASSERT_TRUE(running);
    fs::remove(f.path + "/lock");  // the mission itself is claimed
    ASSERT_EQ(clear_mission(f.path), Cleared::kAtNextStart);
    EXPECT_TRUE(clear_is_asked(f.path));
    EXPECT_TRUE(fs::exists(f.mission));
    fs::remove(f.path + "/lock");
    EXPECT_FALSE(f.open()) << "a second one would have cleared it under the first";
    EXPECT_TRUE(fs::exists(f.mission));
  }
  {
    const auto next = f.open();
    ASSERT_TRUE(next);
    EXPECT_FALSE(next->holds_mission());
    EXPECT_FALSE(clear_is_asked(f.path));
  }
  ASSERT_TRUE(f.fill());
  EXPECT_EQ(clear_mission(f.path), Cleared::kNow);
  EXPECT_FALSE(fs::exists(f.mission));
}

TEST(ClearMission, SaysWhyNot) {
  const Folder f;
  fs::create_directories(f.path);
  const auto nothing = clear_mission(f.path);
  ASSERT_FALSE(nothing);
  EXPECT_NE(nothing.error().find("holds no mission"), std::string::npos);
  EXPECT_TRUE(fs::is_empty(f.path)) << "a folder of somebody else's";
  // What cannot be removed: a folder with something in it.
  fs::create_directories(f.mission + "/something");
  const auto left = clear_mission(f.path);
  ASSERT_FALSE(left);
  EXPECT_NE(left.error().find(kMissionFile), std::string::npos);
  EXPECT_TRUE(clear_is_asked(f.path));
}

TEST(Epoch, OfAMissionIsItsOwnAlsoInFastPace) {
  const Folder f;
  Options options;
  options.agent = Journaled::kLife.agent;
  Config config;
  config.input.source = "sim:room";
  const auto drawn = [&] {
    const auto state = f.open();
    return epoch_of(options, config, *state);
  };
  EXPECT_NE(drawn(), drawn());  // nothing was written: another mission
  ASSERT_TRUE(f.fill());
  EXPECT_EQ(drawn(), Journaled::kLife.epoch);
  ASSERT_EQ(clear_mission(f.path), Cleared::kNow);
  EXPECT_NE(drawn(), drawn());
  const auto none = StateDirectory::open("", options.agent, kBytes);
  EXPECT_EQ(epoch_of(options, config, *none), epoch_of(options, config, *none));
}

TEST(PrivateTmp, IsToldFromEverybodys) {
  constexpr const char* kService =
      "36 25 8:1 / / rw shared:1 - ext4 /dev/sda1 rw\n"
      "90 36 8:1 /var/tmp/systemd-private-0f-mapletd.service-x/tmp /var/tmp rw - ext4 /dev/sda1 "
      "rw\n";
  EXPECT_EQ(private_tmp_of("/var/tmp/flight", kService), "/var/tmp");
  EXPECT_EQ(private_tmp_of("/var/tmp/../lib/flight", kService), "");
  EXPECT_EQ(private_tmp_of("/tmp/flight", kService), "");
  EXPECT_EQ(private_tmp_of("/var/tmpfiles", kService), "");
  EXPECT_EQ(private_tmp_of("/var/tmp/x", "36 25 8:1 / /var/tmp rw - tmpfs none rw\n"), "");
  EXPECT_EQ(private_tmp_of("/var/tmp/x", "garbage\n\n1 2\n"), "");
}

}  // namespace
}  // namespace maplet::test
