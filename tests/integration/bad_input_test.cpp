// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What a person can get wrong: one line that names the file and the remedy, and the exit code.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "drivers/replay/image_file.hpp"
#include "tests/support/patience.hpp"
#include "tests/support/recordings.hpp"
#include "tests/support/run.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet::test {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

std::size_t lines(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

/// A short simulated recording, made once for the whole program.
const fs::path& recording() {
  static const TempDir dir;
  static const fs::path made = [] {
    const fs::path path = dir.path() / "recording";
    const Finished simulated =
        run({"mapletctl", "simulate", "sim:room?frames=30&width=320", "--out", path.string()});
    EXPECT_EQ(simulated.exit_code, 0) << simulated.err;
    return path;
  }();
  return made;
}

class BadRecording : public testing::Test {
 protected:
  void SetUp() override { fs::copy(recording(), source_, fs::copy_options::recursive); }
  std::string uri() const { return "tum:" + source_.string(); }

  TempDir dir_;
  fs::path source_ = dir_.path() / "copy";
  fs::path out_ = dir_.path() / "out";
};

TEST(BadInput, UsageAndConfiguration) {
  EXPECT_EQ(run({"mapletd", "--no-such-option"}).exit_code, 2);
  const TempDir dir;
  const fs::path config = dir.path() / "robot.toml";
  std::ofstream{config} << "[frame]\nbudget_us = -4\n";
  const Finished bad_value = run({"mapletd", "--config", config.string(), "--check-config"});
  EXPECT_EQ(run({"mapletd", "--out", "", "--source", "sim:room"}).exit_code, 2);
  const Finished folder = run({"mapletd", "--config", dir.path().string(), "--check-config"});
  EXPECT_EQ(folder.exit_code, 2);
  EXPECT_THAT(folder.err, HasSubstr(dir.path().string()));
  EXPECT_EQ(bad_value.exit_code, 2);
  EXPECT_THAT(bad_value.err, AllOf(HasSubstr("robot.toml:2"), HasSubstr("frame.budget_us")));
  EXPECT_EQ(lines(bad_value.err), 1u);
  const Finished no_source = run({"mapletd", "--out", dir.path().string(), "--no-dds"});
  EXPECT_EQ(no_source.exit_code, 2);
  EXPECT_THAT(no_source.err, HasSubstr("--source"));
  const Finished scheme = map_it("ftp:somewhere", dir.path() / "out");
  EXPECT_EQ(scheme.exit_code, 2);
  EXPECT_THAT(scheme.err, HasSubstr("tum:"));
}

TEST(BadInput, WhatIsWrongWithTheCommandIsSaidPlainly) {
  const TempDir dir;
  const std::string garbage = (dir / "garbage").string();
  std::ofstream{garbage} << "\x1b[31m\xff\x01\x02 \x90 1 2";
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases{
      {{"mapletd", "--agent", "-1"}, "--agent: Value -1 not in range 0 to 65535"},
      {{"mapletd", "--agent", "70000"}, "70000 not in range 0 to 65535"},
      {{"mapletctl", "bogus"}, "there is no command 'bogus'"},
      {{"mapletctl", "closure", "bogus"}, "there is no command 'bogus'"},
      {{"mapletctl", "solve", "x.g2o", "--budget-us", "-3"}, "-3 is not a number above 0"},
      {{"mapletctl", "solve", "x.g2o", "--budget-us", "inf"}, "inf is not a number above 0"},
      {{"mapletctl", "solve", "x.g2o", "--max-nodes", "1e3"},
       "1e3 is not a whole number from 0 to 2147483647"},
      {{"mapletctl", "solve", "x.g2o", "--max-nodes", "3"}, "16 at least"},
      {{"mapletctl", "solve", "x.g2o", "--out", "./x.g2o"}, "that is an input"},
      {{"mapletctl", "eval", "--truth", garbage, "--estimate", garbage},
       "garbage:1: '?[31m\?\?\?' is no time in seconds"}};
  for (const auto& [command, said] : cases) {
    const Finished done = run(command);
    EXPECT_NE(done.exit_code, 0);
    EXPECT_THAT(done.err, HasSubstr(said));
    EXPECT_EQ(lines(done.err), 1u) << done.err;
  }
}

TEST(BadInput, MissingFolderIsOneLine) {
  const TempDir dir;
  const Finished missing = map_it("tum:/nonexistent/recording", dir.path() / "out");
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.err, HasSubstr("/nonexistent/recording"));
  EXPECT_EQ(lines(missing.err), 1u) << missing.err;
}

TEST(BadInput, OutFolderThatCannotBe) {
  const Finished refused = map_it("sim:room?frames=2&width=320", "/proc/no/such/place");
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("--out"));
}

TEST(BadInput, NoCameraEndsAFiniteRunWithinTenSeconds) {
  const TempDir dir;
  const Finished none = map_it("openni2:", dir.path() / "out");
  EXPECT_EQ(none.exit_code, 1) << none.err;
  EXPECT_LT(none.took, std::chrono::seconds{10} * patience());
  EXPECT_THAT(none.err, HasSubstr("OpenNI2"));
}

TEST(BadInput, NoCameraMakesTheServiceWaitAndSaySo) {
  Process service{{"mapletd", "--source", "openni2:", "--no-dds", "--set", "control.socket=none"}};
  for (int i = 0; i < 100 * patience() && service.err().empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds{50});
  }
  EXPECT_THAT(service.err(), HasSubstr("waiting for a camera"));
  EXPECT_TRUE(service.running());
  service.signal(SIGTERM);
  const Finished stopped = service.wait(std::chrono::seconds{5});
  EXPECT_EQ(stopped.exit_code, 0) << stopped.err;
}

TEST(BadInput, EmptyOniRecording) {
  MAPLET_RECORDING(oni, "oni/openni1_truncated_0frames.oni");
  const TempDir dir;
  const Finished empty = map_it("openni2:" + oni.string(), dir.path() / "out");
  EXPECT_EQ(empty.exit_code, 1) << empty.err;
  EXPECT_THAT(empty.err, HasSubstr("openni1_truncated_0frames.oni"));
  EXPECT_LT(empty.took, std::chrono::seconds{10} * patience());
}

TEST_F(BadRecording, TruncatedImageIsACountedSkip) {
  fs::resize_file(source_ / "depth/000010.png", 200);
  const Finished mapped = map_it(uri(), out_);
  EXPECT_EQ(mapped.exit_code, 0) << mapped.err;
  EXPECT_THAT(mapped.err, AllOf(HasSubstr("000010.png"), HasSubstr("1 images could not be read")));
  const auto report = report_of(out_);
  EXPECT_EQ(report["frames"]["unreadable"], 1);
  EXPECT_EQ(report["frames"]["processed"], 29);
}

TEST_F(BadRecording, ImageSizeThatDiffersNamesBoth) {
  std::string text;
  {
    std::ifstream in{source_ / "camera.toml"};
    text.assign(std::istreambuf_iterator<char>{in}, {});
  }
  text.replace(text.find("width_px = 320"), 14, "width_px = 640");
  std::ofstream{source_ / "camera.toml"} << text;
  const Finished refused = map_it(uri(), out_);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("640"), HasSubstr("320")));
}

TEST_F(BadRecording, ImagesThatThereIsNoRoomForNameTheRemedy) {
  const Finished refused = map_it(uri(), out_, {"--set", "limits.image_width_px=160"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("320 x 240"), HasSubstr("160 x 480"),
                                 HasSubstr("limits.image_width_px = 320")));
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(BadRecording, MissingIntrinsicsNameTheRemedy) {
  fs::remove(source_ / "camera.toml");
  const Finished refused = map_it(uri(), out_);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("camera.toml"), HasSubstr("camera.")));
  const Finished given = map_it(
      uri(), out_,
      {"--set", "camera.width_px=320", "--set", "camera.height_px=240", "--set", "camera.fx_px=270",
       "--set", "camera.fy_px=270", "--set", "camera.cx_px=160", "--set", "camera.cy_px=120"});
  EXPECT_EQ(given.exit_code, 0) << given.err;
}

TEST_F(BadRecording, AWrongDepthUnitIsNoMap) {
  std::string text;
  {
    std::ifstream in{source_ / "camera.toml"};
    text.assign(std::istreambuf_iterator<char>{in}, {});
  }
  const auto unit = text.find("metres_per_unit = ");
  text.replace(unit, text.find('\n', unit) - unit, "metres_per_unit = 1.0");
  std::ofstream{source_ / "camera.toml"} << text;
  const Finished refused = map_it(uri(), out_);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err,
              AllOf(HasSubstr("correct metres_per_unit = 1"), HasSubstr("000000.png")));
}

TEST_F(BadRecording, AFolderThatAnotherRunWritesIsRefused) {
  fs::create_directories(out_);
  const int other = ::open(out_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  ASSERT_EQ(::flock(other, LOCK_EX | LOCK_NB), 0);
  const Finished refused = map_it(uri(), out_);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("another run is writing there"));
  EXPECT_FALSE(fs::exists(out_ / "odometry.tum"));
  ::close(other);
  EXPECT_EQ(map_it(uri(), out_).exit_code, 0);
}

TEST_F(BadRecording, StampsThatGoBackAreACountedSkip) {
  std::ifstream in{source_ / "depth.txt"};
  std::vector<std::string> list;
  for (std::string line; std::getline(in, line);) list.push_back(line);
  in.close();
  std::swap(list[list.size() - 5], list[list.size() - 10]);
  std::ofstream out{source_ / "depth.txt"};
  for (const std::string& line : list) out << line << '\n';
  out.close();
  const Finished mapped = map_it(uri(), out_);
  EXPECT_EQ(mapped.exit_code, 0) << mapped.err;
  EXPECT_GE(report_of(out_)["frames"]["out_of_order"], 1);
}

TEST_F(BadRecording, BlackFramesInTheMiddleAreLostAndThenItGoesOn) {
  const std::vector<std::uint16_t> black(320 * 240, 0);
  for (const char* name : {"000012.png", "000013.png", "000014.png"}) {
    ASSERT_TRUE(
        write_png(source_ / "depth" / name, ImageView<std::uint16_t>{black.data(), 320, 240, 320}));
  }
  const Finished mapped = map_it(uri(), out_);
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  const auto report = report_of(out_);
  EXPECT_EQ(report["frames"]["processed"], 30);
  EXPECT_GE(report["tracking"]["lost"], 3);
  EXPECT_LE(report["tracking"]["lost"], 10);
  std::ifstream odometry{out_ / "odometry.tum"};
  const auto tracked = std::count(std::istreambuf_iterator<char>{odometry}, {}, '\n');
  EXPECT_EQ(tracked, 30 - report["tracking"]["lost"].get<int>());
}

TEST(BadInput, ATypingErrorSpoilsNoEarlierResults) {
  const TempDir dir;
  const fs::path out = dir.path() / "out";
  ASSERT_EQ(map_it("sim:room?frames=10&width=320", out).exit_code, 0);
  const std::string before = text_of(out / "report.json");
  for (const char* source : {"tum:/nonexistent", "sim:hall", "foo:bar", "sim:room?frames=x"}) {
    EXPECT_NE(map_it(source, out).exit_code, 0) << source;
  }
  EXPECT_EQ(text_of(out / "report.json"), before);
  EXPECT_TRUE(fs::exists(out / "maplets/0000.maplet"));
}

TEST(BadInput, TheSmallestMapletsStillHaveDeltaPoses) {
  const TempDir dir;
  const Finished mapped = map_it("sim:room?frames=240&width=320", dir.path() / "out",
                                 {"--set", "maplet.max_bytes=1024"});
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  const auto report = report_of(dir.path() / "out");
  EXPECT_GE(report["delta_poses"]["count"], 1);
  EXPECT_EQ(report["delta_poses"]["unrelated"], 0);
  EXPECT_LE(report["maplets"]["bytes_max"], 1024);
}

TEST(BadInput, LimitsThatNoMemoryHoldsAreAConfigurationError) {
  const std::vector<std::string> huge{"mapletd", "--check-config",
                                      "--set",   "skeleton.max_nodes=1000000",
                                      "--set",   "skeleton.max_factors=10000000"};
  const Finished refused = run(huge);
  EXPECT_EQ(refused.exit_code, 2) << refused.err;
  EXPECT_THAT(refused.err, AllOf(HasSubstr("MiB"), HasSubstr("skeleton")));
}

TEST_F(BadRecording, APathThatIsWrittenOtherwiseIsTheSameRecording) {
  ASSERT_EQ(map_it(uri(), dir_ / "a").exit_code, 0);
  ASSERT_EQ(map_it("tum:" + (source_ / "../copy/").string(), dir_ / "b").exit_code, 0);
  EXPECT_EQ(text_of(dir_ / "a" / "maplets/0000.maplet"),
            text_of(dir_ / "b" / "maplets/0000.maplet"));
  EXPECT_EQ(text_of(dir_ / "a" / "map.svg"), text_of(dir_ / "b" / "map.svg"));
}

TEST_F(BadRecording, ALongerBlindSpellStartsANewMaplet) {
  const std::vector<std::uint16_t> black(320 * 240, 0);
  for (int i = 10; i < 18; ++i) {
    ASSERT_TRUE(write_png(source_ / "depth" / ("0000" + std::to_string(i) + ".png"),
                          ImageView<std::uint16_t>{black.data(), 320, 240, 320}));
  }
  const Finished mapped = map_it(uri(), out_);
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  const auto report = report_of(out_);
  EXPECT_GE(report["tracking"]["lost"], 8);
  EXPECT_EQ(report["maplets"]["count"], 2);
  EXPECT_EQ(report["delta_poses"]["count"], 1);
  EXPECT_THAT(mapped.err,
              AllOf(HasSubstr("tracking lost (no depth)"), HasSubstr("tracking again")));
}

TEST_F(BadRecording, ClockThatJumpsInABlindSpellIsAGap) {
  const std::vector<std::uint16_t> black(320 * 240, 0);
  for (int i = 8; i < 20; ++i) {
    const std::string name = "0000" + std::string(i < 10 ? "0" : "") + std::to_string(i) + ".png";
    ASSERT_TRUE(
        write_png(source_ / "depth" / name, ImageView<std::uint16_t>{black.data(), 320, 240, 320}));
  }
  std::ifstream in{source_ / "depth.txt"};
  std::vector<std::string> list;
  for (std::string line; std::getline(in, line);) list.push_back(line);
  in.close();
  std::ofstream out{source_ / "depth.txt"};
  int frame = 0;
  for (const std::string& line : list) {
    const bool jumps = !line.empty() && line[0] != '#' && ++frame > 12;
    const auto space = line.find(' ');
    out << (jumps ? std::to_string(std::stod(line) + 1e7) + line.substr(space) : line) << '\n';
  }
  out.close();
  const Finished mapped = map_it(uri(), out_);
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  EXPECT_THAT(mapped.err, HasSubstr("tracking lost"));
}

TEST_F(BadRecording, NothingButBlackFramesIsOneLineAndNoMap) {
  const std::vector<std::uint16_t> black(320 * 240, 0);
  for (const auto& entry : fs::directory_iterator{source_ / "depth"}) {
    ASSERT_TRUE(write_png(entry.path(), ImageView<std::uint16_t>{black.data(), 320, 240, 320}));
  }
  const Finished mapped = map_it(uri(), out_);
  EXPECT_EQ(mapped.exit_code, 1);
  EXPECT_THAT(mapped.err, HasSubstr("none of 30 frames could be tracked"));
}

}  // namespace
}  // namespace maplet::test
