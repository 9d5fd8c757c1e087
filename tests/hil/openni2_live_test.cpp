// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A synthetic camera behind the real OpenNI2 runtime: openni2_synth/script.hpp says what it can do.
#include <OpenNI.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <thread>

#include "drivers/open_source.hpp"
#include "tests/hil/openni2_truth.hpp"
#include "tools/solve/heap_count.hpp"

namespace maplet {
namespace {

using std::chrono::milliseconds;
using test::Truth;
using Kind = SourceError::Kind;

constexpr const char* kWorld = "world=room sim.seed=3 sim.noise=0 ";

/// Opens the camera as the script wants it to be.
OpenedSource open_camera(const std::string& script, const SourceOptions& options = {}) {
  setenv("MAPLET_SYNTH", (kWorld + script).c_str(), 1);
  return open_source("openni2:", options);
}

SourceOptions small() {
  SourceOptions options;
  options.camera = Truth::camera(320);
  return options;
}

Expected<DepthFrame> patient(DepthSource& source) {
  for (int i = 0; i < 20; ++i) {
    auto frame = source.next(Deadline::never());
    if (frame || frame.error().code != ErrorCode::kTimeout) return frame;
  }
  return fail(ErrorCode::kTimeout, "out of patience");
}

TEST(Openni2Live, DeliversWhatTheCameraSees) {
  auto source = open_camera("rate_hz=50", small());
  ASSERT_TRUE(source) << source.error().what;
  const Truth truth{320, 50.0};
  std::optional<Stamp> last;
  for (int i = 0; i < 10; ++i) {
    const auto frame = patient(**source);
    ASSERT_TRUE(frame) << frame.error().what;
    ASSERT_TRUE(truth.same_depth(*frame)) << "frame " << frame->index;
    EXPECT_TRUE(!last || frame->stamp > *last);
    last = frame->stamp;
  }
  EXPECT_EQ((*source)->counters().read, 10u);
  EXPECT_FALSE((*source)->length());
}

TEST(Openni2Live, ChoosesVgaAndTheNominalCamera) {
  auto source = open_camera("rate_hz=30");
  ASSERT_TRUE(source) << source.error().what;
  const auto frame = patient(**source);
  ASSERT_TRUE(frame) << frame.error().what;
  EXPECT_EQ(frame->depth.width_px, 640);
  EXPECT_EQ(frame->depth.height_px, 480);
  EXPECT_EQ(frame->metres_per_unit, 0.001);
  EXPECT_NEAR(frame->camera.fx_px, Truth::camera(640).fx_px, 0.01);
  EXPECT_NEAR(frame->camera.fy_px, Truth::camera(640).fy_px, 0.01);
}

TEST(Openni2Live, BringsRegisteredGray) {
  auto source = open_camera("rate_hz=25", small());
  ASSERT_TRUE(source) << source.error().what;
  const Truth truth{320, 25.0};
  int with_gray = 0;
  for (int i = 0; i < 10; ++i) {
    const auto frame = patient(**source);
    ASSERT_TRUE(frame) << frame.error().what;
    if (frame->gray.empty()) continue;
    ++with_gray;
    ASSERT_TRUE(truth.same_gray(*frame)) << "frame " << frame->index;
  }
  EXPECT_GE(with_gray, 5);
}

TEST(Openni2Live, LeavesGrayOutWhereItIsNotRegistered) {
  for (const char* script : {"colour=0", "registration=0"}) {
    auto source = open_camera(script, small());
    ASSERT_TRUE(source) << source.error().what;
    const auto frame = patient(**source);
    ASSERT_TRUE(frame) << frame.error().what;
    EXPECT_TRUE(frame->gray.empty());
  }
}

TEST(Openni2Live, TurnsBackAStubbornMirror) {
  auto source = open_camera("mirror=1 rate_hz=25", small());
  ASSERT_TRUE(source) << source.error().what;
  const Truth truth{320, 25.0};
  for (int i = 0; i < 3; ++i) {
    const auto frame = patient(**source);
    ASSERT_TRUE(frame) << frame.error().what;
    ASSERT_TRUE(truth.same_depth(*frame));
    ASSERT_TRUE(frame->gray.empty() || truth.same_gray(*frame));
  }
}

TEST(Openni2Live, CountsWhatASlowReaderMisses) {
  auto source = open_camera("rate_hz=100", small());
  ASSERT_TRUE(source) << source.error().what;
  const Truth truth{320, 100.0};
  for (int i = 0; i < 4; ++i) {
    const auto frame = patient(**source);
    ASSERT_TRUE(frame) << frame.error().what;
    ASSERT_TRUE(truth.same_depth(*frame));
    std::this_thread::sleep_for(milliseconds{150});
  }
  const auto counters = (*source)->counters();
  EXPECT_EQ(counters.read, 4u);
  EXPECT_GT(counters.dropped, 5u);
}

TEST(Openni2Live, SurvivesUnplugAndReplug) {
  auto source = open_camera("rate_hz=50 unplug=8 replug_ms=400", small());
  ASSERT_TRUE(source) << source.error().what;
  auto frame = patient(**source);
  int before = 0;
  for (; frame; frame = patient(**source)) ++before;
  EXPECT_GT(before, 0);
  EXPECT_LE(before, 8);
  EXPECT_EQ(frame.error().code, ErrorCode::kDevice);
  EXPECT_NE((*source)->detail().find("disconnected"), std::string_view::npos);

  setenv("MAPLET_SYNTH", kWorld, 1);
  const auto absent = open_source("openni2:", small());
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().kind, Kind::kAbsent) << absent.error().what;
  OpenedSource again = open_source("openni2:", small());
  for (int i = 0; i < 50 && !again; ++i) {
    std::this_thread::sleep_for(milliseconds{100});
    again = open_source("openni2:", small());
  }
  ASSERT_TRUE(again) << again.error().what;
  EXPECT_TRUE(patient(**again));
}

TEST(Openni2Live, SaysThatACameraIsMissing) {
  // In a process of its own: the runtime starts once in each.
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(
      {
        const auto absent = open_camera("absent=1");
        if (absent) std::_Exit(1);
        std::fputs(absent.error().what.c_str(), stderr);
        std::_Exit(absent.error().kind == Kind::kAbsent ? 0 : 2);
      },
      testing::ExitedWithCode(0), "no OpenNI2 device found");
}

TEST(Openni2Live, OpensByUriAndListsWhatIsThere) {
  setenv("MAPLET_SYNTH", kWorld, 1);
  auto source = open_source("openni2:synth://camera", small());
  ASSERT_TRUE(source) << source.error().what;
  source->reset();
  const auto other = open_source("openni2:synth://other", small());
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().kind, Kind::kAbsent);
  EXPECT_NE(other.error().what.find("synth://camera"), std::string::npos) << other.error().what;
}

TEST(Openni2Live, RefusesASizeThatTheCameraLacks) {
  SourceOptions options = small();
  options.camera.width_px = 123;
  const auto source = open_camera("", options);
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().kind, Kind::kBad);
  EXPECT_NE(source.error().what.find("123x240"), std::string::npos) << source.error().what;
  EXPECT_NE(source.error().what.find("320x240 mm 100 Hz"), std::string::npos)
      << source.error().what;
}

/// What OpenNI2 itself allocates on the reader's thread for `frames` frames.
std::uint64_t of_openni2(int frames) {
  setenv("MAPLET_SYNTH", (std::string{kWorld} + "rate_hz=50 colour=0").c_str(), 1);
  openni::Device device;
  openni::VideoStream stream;
  EXPECT_EQ(device.open("synth://camera"), openni::STATUS_OK);
  EXPECT_EQ(stream.create(device, openni::SENSOR_DEPTH), openni::STATUS_OK);
  EXPECT_EQ(stream.start(), openni::STATUS_OK);
  openni::VideoStream* streams[] = {&stream};
  std::uint64_t count = 0;
  for (int i = 0; i < frames; ++i) {
    int ready = 0;
    EXPECT_EQ(openni::OpenNI::waitForAnyStream(streams, 1, &ready, 2000), openni::STATUS_OK);
    const std::uint64_t before = graphs::heap_allocations();
    openni::VideoFrameRef frame;
    (void)openni::OpenNI::waitForAnyStream(streams, 1, &ready, 0);
    EXPECT_EQ(stream.readFrame(&frame), openni::STATUS_OK);
    count += graphs::heap_allocations() - before;
  }
  stream.stop();
  stream.destroy();
  device.close();
  return count;
}

TEST(Openni2Live, AllocatesNothingBesideOpenNI2) {
  constexpr int kMany = 40;
  std::uint64_t ours = 0;
  {
    auto source = open_camera("rate_hz=50 colour=0", small());
    ASSERT_TRUE(source) << source.error().what;
    ASSERT_TRUE(patient(**source));
    const std::uint64_t before = graphs::heap_allocations();
    for (int i = 0; i < kMany; ++i) ASSERT_TRUE(patient(**source));
    ours = graphs::heap_allocations() - before;
  }
  const std::uint64_t theirs = of_openni2(kMany);
  std::printf("%llu allocations of OpenNI2's for %d frames, %llu with us\n",
              static_cast<unsigned long long>(theirs), kMany,
              static_cast<unsigned long long>(ours));
  // A frame that is there only when it is read costs OpenNI2 a look more: less than one a frame.
  EXPECT_LT(ours, theirs + kMany);
}

TEST(Openni2Live, RefusesACameraThatClaimsNoRate) {
  for (const SourceOptions& options : {SourceOptions{}, small()}) {
    const auto source = open_camera("claimed_hz=0", options);
    ASSERT_FALSE(source);
    EXPECT_EQ(source.error().kind, Kind::kBad);
    EXPECT_NE(source.error().what.find("rate above 0 Hz; there are 320x240 mm 0 Hz"),
              std::string::npos)
        << source.error().what;
  }
}

TEST(Openni2Live, RefusesACameraWithoutDepth) {
  const auto source = open_camera("depth=0", small());
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().kind, Kind::kBad);
  EXPECT_NE(source.error().what.find("no depth sensor"), std::string::npos) << source.error().what;
}

TEST(Openni2Live, GivesUpOnACameraThatFallsSilent) {
  auto source = open_camera("silent=3 rate_hz=50", small());
  ASSERT_TRUE(source) << source.error().what;
  Expected<DepthFrame> frame = patient(**source);
  while (frame) frame = patient(**source);
  EXPECT_EQ(frame.error().code, ErrorCode::kDevice);
  EXPECT_NE((*source)->detail().find("sends no frames"), std::string_view::npos);
}

TEST(Openni2Live, LooksAtTheDeadline) {
  auto source = open_camera("silent=1", small());
  ASSERT_TRUE(source) << source.error().what;
  ASSERT_TRUE(patient(**source));
  const MonotonicClock clock;
  const auto began = clock.now();
  const auto frame = (*source)->next(Deadline{clock, milliseconds{60}});
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error().code, ErrorCode::kTimeout);
  EXPECT_LT(clock.now() - began, milliseconds{900});
}

}  // namespace
}  // namespace maplet
