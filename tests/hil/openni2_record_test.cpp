// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Recordings that OpenNI2 itself makes of the synthetic camera, played through our source.
#include <OpenNI.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "drivers/openni2/openni2_source.hpp"
#include "drivers/openni2/runtime.hpp"
#include "tests/hil/openni2_truth.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet {
namespace {

using test::Truth;

constexpr int kFrames = 12;
constexpr double kRateHz = 25.0;

struct What {
  bool depth = true;
  bool colour = false;
  bool mirror = false;
};

void start(openni::VideoStream& stream, const openni::Device& device, openni::SensorType type,
           bool mirror, openni::Recorder& recorder) {
  ASSERT_EQ(stream.create(device, type), openni::STATUS_OK);
  stream.setMirroringEnabled(mirror);
  ASSERT_EQ(recorder.attach(stream, false), openni::STATUS_OK);
}

/// Records kFrames frames or a few more.
void record(const std::string& file, const What& what) {
  setenv("MAPLET_SYNTH", "world=room sim.seed=3 sim.noise=0 rate_hz=25", 1);
  ASSERT_TRUE(openni2::start_runtime());
  openni::Device device;
  ASSERT_EQ(device.open(openni::ANY_DEVICE), openni::STATUS_OK);
  openni::VideoStream depth, colour;
  openni::Recorder recorder;
  ASSERT_EQ(recorder.create(file.c_str()), openni::STATUS_OK);
  if (what.depth) start(depth, device, openni::SENSOR_DEPTH, what.mirror, recorder);
  if (what.colour) start(colour, device, openni::SENSOR_COLOR, what.mirror, recorder);
  ASSERT_EQ(recorder.start(), openni::STATUS_OK);
  if (what.depth) depth.start();
  if (what.colour) colour.start();
  openni::VideoStream& counted = what.depth ? depth : colour;
  for (int i = 0; i < kFrames; ++i) {
    openni::VideoFrameRef frame;
    ASSERT_EQ(counted.readFrame(&frame), openni::STATUS_OK);
  }
  recorder.stop();
  recorder.destroy();
  for (openni::VideoStream* stream : {&depth, &colour}) {
    if (stream->isValid()) stream->stop();
    stream->destroy();
  }
  device.close();
}

class Openni2Record : public testing::Test {
 protected:
  test::TempDir dir_;
  std::string file_ = (dir_ / "run.oni").string();
};

TEST_F(Openni2Record, ComesBackFrameByFrame) {
  for (const bool mirror : {false, true}) {
    ASSERT_NO_FATAL_FAILURE(record(file_, {.mirror = mirror}));
    auto source = open_openni2(file_, {});
    ASSERT_TRUE(source) << source.error().what;
    ASSERT_GE((*source)->length(), static_cast<std::uint64_t>(kFrames));
    const Truth truth{320, kRateHz};
    std::uint64_t frames = 0;
    auto frame = (*source)->next(Deadline::never());
    for (; frame; frame = (*source)->next(Deadline::never())) {
      ++frames;
      ASSERT_TRUE(truth.same_recorded_depth(*frame))
          << "frame " << frame->index << " mirror " << mirror;
      EXPECT_NEAR(frame->camera.fx_px, Truth::camera(320).fx_px, 0.01);
    }
    EXPECT_EQ(frame.error().code, ErrorCode::kEnd);
    EXPECT_EQ(frames, (*source)->length());
    std::filesystem::remove(file_);
  }
}

TEST_F(Openni2Record, PairsTheSameGrayEveryTime) {
  ASSERT_NO_FATAL_FAILURE(record(file_, {.colour = true}));
  SourceOptions options;
  options.registered_to_colour = true;
  const Truth truth{320, kRateHz};
  std::vector<bool> first;
  for (int round = 0; round < 3; ++round) {
    auto source = open_openni2(file_, options);
    ASSERT_TRUE(source) << source.error().what;
    std::vector<bool> gray;
    while (const auto frame = (*source)->next(Deadline::never())) {
      gray.push_back(!frame->gray.empty());
      ASSERT_TRUE(truth.same_recorded_depth(*frame));
      ASSERT_TRUE(!gray.back() || truth.same_gray(*frame)) << "frame " << frame->index;
    }
    EXPECT_EQ(gray.size(), (*source)->length());
    EXPECT_GE(std::count(gray.begin(), gray.end(), true), kFrames - 2);
    if (round == 0) first = gray;
    EXPECT_EQ(gray, first);
  }
  options.registered_to_colour = false;
  auto source = open_openni2(file_, options);
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_TRUE((*source)->next(Deadline::never())->gray.empty());
}

TEST_F(Openni2Record, WithoutDepthIsRefused) {
  ASSERT_NO_FATAL_FAILURE(record(file_, {.depth = false, .colour = true}));
  const auto source = open_openni2(file_, {});
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().kind, SourceError::Kind::kBad);
  EXPECT_NE(source.error().what.find("holds no depth stream"), std::string::npos)
      << source.error().what;
}

}  // namespace
}  // namespace maplet
