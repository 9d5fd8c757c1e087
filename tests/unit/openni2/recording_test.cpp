// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <chrono>

#include "drivers/openni2/openni2_source.hpp"
#include "tests/support/patience.hpp"
#include "tests/support/recordings.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet {
namespace {

using Kind = SourceError::Kind;

struct Played {
  std::vector<std::uint64_t> hashes;
  std::vector<Stamp> stamps;
};

std::uint64_t hash(const ImageView<std::uint16_t>& image) {
  std::uint64_t sum = 14695981039346656037u;
  for (int v = 0; v < image.height_px; ++v) {
    for (int u = 0; u < image.width_px; ++u) sum = (sum ^ image.at(u, v)) * 1099511628211u;
  }
  return sum;
}

Played play(DepthSource& source) {
  Played played;
  auto frame = source.next(Deadline::never());
  for (; frame; frame = source.next(Deadline::never())) {
    played.hashes.push_back(hash(frame->depth));
    played.stamps.push_back(frame->stamp);
  }
  EXPECT_EQ(frame.error().code, ErrorCode::kEnd) << frame.error().what;
  return played;
}

TEST(OniRecording, PlaysEveryFrameTheSameEveryTime) {
  MAPLET_RECORDING(file, "oni/openni2_depth640_img320.oni");
  Played first;
  for (int round = 0; round < 3; ++round) {
    auto source = open_openni2(file.string(), {});
    ASSERT_TRUE(source) << source.error().what;
    EXPECT_EQ((*source)->length(), 24u);
    const Played played = play(**source);
    EXPECT_EQ(played.hashes.size(), 24u);
    EXPECT_EQ((*source)->counters().read, 24u);
    EXPECT_EQ((*source)->detail(), "");
    if (round == 0) first = played;
    EXPECT_EQ(played.hashes, first.hashes);
    EXPECT_EQ(played.stamps, first.stamps);
  }
  EXPECT_EQ(first.stamps[0], Stamp{0});
  EXPECT_EQ(first.stamps[1], std::chrono::microseconds{33369});
}

TEST(OniRecording, LosesNothingToASlowReader) {
  MAPLET_RECORDING(file, "oni/openni2_depth640_img320.oni");
  auto source = open_openni2(file.string(), {});
  ASSERT_TRUE(source) << source.error().what;
  // A deadline that has passed: every call that finds nothing yet triggers the player once more.
  const ManualClock clock;
  const Deadline passed{clock, Duration{0}};
  std::size_t frames = 0;
  for (;;) {
    const auto frame = (*source)->next(passed);
    frames += frame.has_value();
    if (!frame && frame.error().code == ErrorCode::kEnd) break;
    ASSERT_TRUE(frame || frame.error().code == ErrorCode::kTimeout);
  }
  EXPECT_EQ(frames, 24u);
}

TEST(OniRecording, FollowsItsFieldOfViewOrTheConfiguration) {
  MAPLET_RECORDING(file, "oni/openni2_depth640_img320.oni");
  auto nominal = open_openni2(file.string(), {});
  ASSERT_TRUE(nominal) << nominal.error().what;
  const auto frame = (*nominal)->next(Deadline::never());
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->camera.width_px, 640);
  EXPECT_NEAR(frame->camera.fx_px, 570.34, 0.1);
  EXPECT_EQ(frame->camera.cx_px, 319.5);
  EXPECT_EQ(frame->metres_per_unit, 0.001);
  nominal->reset();

  SourceOptions options;
  options.camera = {640, 480, 575.0, 576.0, 318.0, 241.0};
  auto configured = open_openni2(file.string(), options);
  ASSERT_TRUE(configured) << configured.error().what;
  EXPECT_EQ((*configured)->next(Deadline::never())->camera.fy_px, 576.0);
  configured->reset();

  options.camera.width_px = 320;
  const auto wrong = open_openni2(file.string(), options);
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.error().what.find("640x480"), std::string::npos) << wrong.error().what;
  EXPECT_NE(wrong.error().what.find("320x480"), std::string::npos) << wrong.error().what;
}

std::string quick_error(const std::string& where, Kind kind) {
  const auto began = std::chrono::steady_clock::now();
  const auto opened = open_openni2(where, {});
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds{5} * test::patience());
  if (opened) return "it opened";
  EXPECT_EQ(opened.error().kind, kind) << opened.error().what;
  EXPECT_EQ(opened.error().what.find('\n'), std::string::npos) << opened.error().what;
  return opened.error().what;
}

TEST(OniRecording, RefusesAnEmptyOne) {
  MAPLET_RECORDING(file, "oni/openni1_truncated_0frames.oni");
  const std::string what = quick_error(file.string(), Kind::kBad);
  EXPECT_NE(what.find("openni1_truncated_0frames.oni"), std::string::npos) << what;
  EXPECT_NE(what.find("empty"), std::string::npos) << what;
}

TEST(OniRecording, RefusesWhatIsNone) {
  const test::TempDir dir;
  test::write_bytes(dir / "empty.oni", "");
  test::write_bytes(dir / "text.oni", "this is not a recording at all, though it is long enough");
  for (const char* name : {"empty.oni", "text.oni"}) {
    const std::string what = quick_error((dir / name).string(), Kind::kBad);
    EXPECT_NE(what.find(name), std::string::npos) << what;
  }
  EXPECT_NE(quick_error((dir / "missing.oni").string(), Kind::kBad).find("No such file"),
            std::string::npos);
  std::filesystem::create_directory(dir / "folder.oni");
  EXPECT_NE(quick_error((dir / "folder.oni").string(), Kind::kBad).find("not a file"),
            std::string::npos);
  const auto deep = dir.path() / std::string(250, 'd');
  std::filesystem::create_directory(deep);
  test::write_bytes(deep / "x.oni", "x");
  EXPECT_NE(quick_error((deep / "x.oni").string(), Kind::kBad).find("255 bytes"),
            std::string::npos);
}

TEST(OniRecording, EndsWhereItWasCutOff) {
  MAPLET_RECORDING(file, "oni/openni2_depth640_img320.oni");
  const test::TempDir dir;
  const std::string whole = test::read_bytes(file);
  test::write_bytes(dir / "cut.oni", whole.substr(0, whole.size() / 2));
  const auto began = std::chrono::steady_clock::now();
  auto source = open_openni2((dir / "cut.oni").string(), {});
  if (source) {
    const std::size_t frames = play(**source).hashes.size();
    EXPECT_LT(frames, 24u);
    EXPECT_EQ((*source)->counters().unreadable, 24 - frames);
    EXPECT_NE((*source)->detail().find("cut.oni"), std::string_view::npos);
  } else {
    EXPECT_NE(source.error().what.find("cut.oni"), std::string::npos) << source.error().what;
  }
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds{9} * test::patience());
}

TEST(Openni2Camera, IsAbsentWithoutOne) {
  const std::string what = quick_error("9999/0000@0/0", Kind::kAbsent);
  EXPECT_NE(what.find("9999/0000@0/0"), std::string::npos) << what;
}

}  // namespace
}  // namespace maplet
