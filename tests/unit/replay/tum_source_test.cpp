// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/tum_source.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/support/recordings.hpp"
#include "tests/unit/replay/images.hpp"

namespace maplet {
namespace {

using test::view;
using test::write_bytes;

constexpr int kWidth = 8;
constexpr int kHeight = 6;

std::string camera_toml(std::string_view more) {
  return fmt::format(
      "[depth]\nwidth_px = {}\nheight_px = {}\nfx_px = 8.0\nfy_px = 8.0\ncx_px = 3.5\n"
      "cy_px = 2.5\nmetres_per_unit = 0.001\n{}\n",
      kWidth, kHeight, more);
}

/// A recording that a test writes and spoils.
class TumSourceTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(dir_ / "depth");
    std::filesystem::create_directory(dir_ / "rgb");
    write_bytes(dir_ / "camera.toml", camera_toml(""));
  }

  static std::string name(int i) { return fmt::format("depth/{}.png", i); }

  /// Frame i: all pixels 1000 + i, save an invalid 0, a 65535 and a 7.
  void write_depth(int i, int width = kWidth, int height = kHeight) {
    std::vector<std::uint16_t> pixels(static_cast<std::size_t>(width * height),
                                      static_cast<std::uint16_t>(1000 + i));
    pixels[0] = 0;
    pixels[1] = 65535;
    pixels[2] = 7;
    ASSERT_TRUE(write_png(dir_ / name(i), view(pixels, width)));
  }

  /// Frames at 0.0, 0.1, 0.2, ...
  void write_frames(int count) {
    std::string list = "# timestamp filename\n";
    for (int i = 0; i < count; ++i) {
      write_depth(i);
      list += fmt::format("{}.{} {}\n", i / 10, i % 10, name(i));
    }
    write_bytes(dir_ / "depth.txt", list);
  }

  void truncate(const std::string& file) {
    std::filesystem::resize_file(dir_ / file, std::filesystem::file_size(dir_ / file) / 2);
  }

  OpenedSource open(const TumSelection& selection = {}) {
    return TumSource::open(dir_.path(), selection, options_);
  }

  std::string error(const TumSelection& selection = {}) {
    auto opened = open(selection);
    if (opened) return "it opened";
    EXPECT_EQ(opened.error().kind, SourceError::Kind::kBad);
    EXPECT_EQ(opened.error().what.find('\n'), std::string::npos);
    return opened.error().what;
  }

  /// The values of the frames that come, by their middle pixel.
  static std::vector<int> play(DepthSource& source) {
    std::vector<int> values;
    for (auto frame = source.next(Deadline::never()); frame;
         frame = source.next(Deadline::never())) {
      values.push_back(frame->depth.at(4, 3) - 1000);
    }
    EXPECT_EQ(source.next(Deadline::never()).error().code, ErrorCode::kEnd);
    return values;
  }

  static bool says(const std::string& text, std::string_view part) {
    return text.find(part) != std::string::npos;
  }

  test::TempDir dir_;
  SourceOptions options_;
};

TEST_F(TumSourceTest, PlaysAFolderInOrder) {
  write_frames(12);
  auto source = open();
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ((*source)->length(), 12u);
  const auto first = (*source)->next(Deadline::never());
  ASSERT_TRUE(first);
  EXPECT_EQ(first->index, 0u);
  EXPECT_EQ(first->camera.fx_px, 8.0);
  EXPECT_EQ(first->metres_per_unit, 0.001);
  EXPECT_EQ(first->depth.width_px, kWidth);
  EXPECT_EQ(first->depth.height_px, kHeight);
  EXPECT_TRUE(first->gray.empty());
  const auto second = (*source)->next(Deadline::never());
  ASSERT_TRUE(second);
  EXPECT_EQ(second->index, 1u);
  EXPECT_EQ(second->stamp, Stamp{100'000'000});
  EXPECT_EQ(play(**source), (std::vector<int>{2, 3, 4, 5, 6, 7, 8, 9, 10, 11}));
  EXPECT_EQ((*source)->counters().read, 12u);
  EXPECT_EQ((*source)->detail(), "");
}

TEST_F(TumSourceTest, PlaysAPart) {
  write_frames(12);
  auto source = open({3, 3, 2});
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ((*source)->length(), 3u);
  EXPECT_EQ(play(**source), (std::vector<int>{3, 5, 7}));
  EXPECT_EQ(play(*open({10, 100, 1}).value()), (std::vector<int>{10, 11}));
  EXPECT_EQ(play(*open({10, 100, std::uint64_t(-1)}).value()), (std::vector<int>{10}));
  EXPECT_TRUE(says(error({12, 1, 1}), "lists 12 frames, none is left from first=12"));
}

TEST_F(TumSourceTest, MapsInvalidValuesToZero) {
  write_frames(1);
  write_bytes(dir_ / "camera.toml", camera_toml("invalid_values = [0, 65535, 7]"));
  auto source = open();
  const auto frame = (*source)->next(Deadline::never());
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->depth.at(1, 0), 0);
  EXPECT_EQ(frame->depth.at(2, 0), 0);
  EXPECT_EQ(frame->depth.at(3, 0), 1000);
}

TEST_F(TumSourceTest, TakesTheConfigurationsCameraWhenThereIsNoFile) {
  write_frames(1);
  std::filesystem::remove(dir_ / "camera.toml");
  const std::string what = error();
  EXPECT_TRUE(says(what, "camera.toml") && says(what, "camera.width_px")) << what;
  options_.camera = {kWidth, kHeight, 9.0, 9.0, 3.5, 2.5};
  options_.metres_per_unit = 0.0002;
  options_.invalid_values = {65535};
  auto source = open();
  ASSERT_TRUE(source) << source.error().what;
  const auto frame = (*source)->next(Deadline::never());
  EXPECT_EQ(frame->camera.fx_px, 9.0);
  EXPECT_EQ(frame->metres_per_unit, 0.0002);
  EXPECT_EQ(frame->depth.at(1, 0), 0);
  EXPECT_EQ(frame->depth.at(2, 0), 7);
}

TEST_F(TumSourceTest, SkipsDamagedAndMissingImagesAndSaysSo) {
  write_frames(6);
  truncate(name(1));
  std::filesystem::remove(dir_ / name(3));
  auto source = open();
  ASSERT_TRUE(source) << source.error().what;
  ASSERT_TRUE((*source)->next(Deadline::never()));
  const auto after = (*source)->next(Deadline::never());
  ASSERT_TRUE(after);
  EXPECT_EQ(after->index, 2u);  // the gap shows
  EXPECT_TRUE(says(std::string{(*source)->detail()}, "depth/1.png: damaged PNG"));
  EXPECT_EQ(play(**source), (std::vector<int>{4, 5}));
  EXPECT_TRUE(says(std::string{(*source)->detail()}, "depth/3.png: No such file"));
  EXPECT_EQ((*source)->counters().read, 4u);
  EXPECT_EQ((*source)->counters().unreadable, 2u);
}

TEST_F(TumSourceTest, OpensWhenTheFirstImagesAreDamaged) {
  write_frames(3);
  truncate(name(0));
  write_bytes(dir_ / name(1), "");
  EXPECT_EQ(play(*open().value()), (std::vector<int>{2}));
}

TEST_F(TumSourceTest, RefusesARecordingWithoutOneGoodImage) {
  write_frames(3);
  for (int i = 0; i < 3; ++i) truncate(name(i));
  const std::string what = error();
  EXPECT_TRUE(says(what, "no depth image can be read") && says(what, "depth/0.png")) << what;
}

TEST_F(TumSourceTest, NamesBothSizesOfAnImageThatDiffers) {
  write_frames(2);
  write_depth(0, kWidth * 2, kHeight);
  const std::string what = error();
  EXPECT_TRUE(says(what, "depth/0.png") && says(what, "16x6") && says(what, "8x6")) << what;
}

TEST_F(TumSourceTest, SkipsALaterImageOfAnotherSize) {
  write_frames(3);
  write_depth(1, kWidth, kHeight * 2);
  auto source = open();
  EXPECT_EQ(play(**source), (std::vector<int>{0, 2}));
  EXPECT_TRUE(says(std::string{(*source)->detail()}, "image is 8x12, expected 8x6"));
}

TEST_F(TumSourceTest, SkipsStampsOutOfOrder) {
  for (int i = 0; i < 6; ++i) write_depth(i);
  write_bytes(dir_ / "depth.txt",
              "0.1 depth/0.png\n0.3 depth/1.png\n0.2 depth/2.png\n0.3 depth/3.png\n"
              "0.4 depth/4.png\n-5.0 depth/5.png\n");
  auto source = open();
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ(play(**source), (std::vector<int>{0, 2, 3, 4}));
  EXPECT_EQ((*source)->counters().out_of_order, 2u);
  EXPECT_TRUE(says(std::string{(*source)->detail()}, "depth.txt:6: stamp is out of order"));
}

TEST_F(TumSourceTest, AWrongStampCostsItsOwnFrameAndNoOther) {
  for (int i = 0; i < 7; ++i) write_depth(i);
  // An hour ahead, twice the same, and one from long ago.
  write_bytes(dir_ / "depth.txt",
              "0.1 depth/0.png\n3600.2 depth/1.png\n0.3 depth/2.png\n0.3 depth/3.png\n"
              "0.4 depth/4.png\n-5.0 depth/5.png\n0.5 depth/6.png\n");
  auto source = open();
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ(play(**source).size(), 4u);
  EXPECT_EQ((*source)->counters().out_of_order, 3u);
  EXPECT_EQ((*source)->counters().read, 4u);
}

TEST_F(TumSourceTest, SkipsLinesThatMakeNoSense) {
  for (int i = 0; i < 2; ++i) write_depth(i);
  write_bytes(dir_ / "depth.txt", "rubbish\n0.1 depth/0.png\nx depth/0.png\n0.2 depth/1.png\n0.3");
  auto source = open();
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ(play(**source), (std::vector<int>{0, 1}));
  EXPECT_EQ((*source)->counters().unreadable, 3u);
  EXPECT_TRUE(says(std::string{(*source)->detail()}, "depth.txt:5: expected 'stamp file'"));
}

TEST_F(TumSourceTest, NamesWhatIsMissing) {
  EXPECT_TRUE(says(error(), "depth.txt: No such file")) << error();
  write_bytes(dir_ / "depth.txt", "# nothing\n");
  EXPECT_TRUE(says(error(), "depth.txt: lists no frames")) << error();
  write_bytes(dir_ / "depth.txt", "# nothing\nrubbish\n");
  EXPECT_TRUE(says(error(), "depth.txt:2: expected 'stamp file'")) << error();
  write_frames(1);
  write_bytes(dir_ / "camera.toml", "[depth]\nwidth_px = 8\n");
  EXPECT_TRUE(says(error(), "camera.toml: depth.height_px is missing")) << error();
  const auto nowhere = TumSource::open(dir_ / "nowhere", {}, options_);
  EXPECT_TRUE(says(nowhere.error().what, "nowhere: No such file")) << nowhere.error().what;
  const auto file = TumSource::open(dir_ / "camera.toml", {}, options_);
  EXPECT_TRUE(says(file.error().what, "not a folder")) << file.error().what;
}

TEST_F(TumSourceTest, LooksAtTheDeadlineBetweenSkippedFrames) {
  write_frames(4);
  for (int i = 1; i < 3; ++i) truncate(name(i));
  auto source = open();
  ASSERT_TRUE((*source)->next(Deadline::never()));
  const ManualClock clock;
  const Deadline passed{clock, Duration{0}};
  EXPECT_EQ((*source)->next(passed).error().code, ErrorCode::kTimeout);
  EXPECT_EQ((*source)->next(passed).error().code, ErrorCode::kTimeout);
  EXPECT_TRUE((*source)->next(passed));  // a good frame comes all the same
}

class TumGray : public TumSourceTest {
 protected:
  void SetUp() override {
    TumSourceTest::SetUp();
    write_frames(4);
    write_bytes(dir_ / "camera.toml", camera_toml("registered_to_colour = true"));
    std::vector<std::uint8_t> rgb(kWidth * kHeight * 3);
    for (const int level : {10, 20, 30}) {
      std::fill(rgb.begin(), rgb.end(), static_cast<std::uint8_t>(level));
      const std::string file = fmt::format("rgb/{}.{}", level, level == 20 ? "jpg" : "png");
      level == 20 ? test::write_jpeg(dir_ / file, kWidth, kHeight, rgb)
                  : test::write_colour_png(dir_ / file, kWidth, kHeight, rgb);
    }
    // Not in order; 0.1 is nearest to 0.099, 0.2 has none within 20 ms.
    write_bytes(dir_ / "rgb.txt",
                "0.310 rgb/30.png\n0.000 rgb/10.png\n0.099 rgb/20.jpg\n0.115 rgb/10.png\n"
                "0.2201 rgb/10.png\n0.1799 rgb/30.png\n");
  }

  std::vector<int> levels(DepthSource& source) {
    std::vector<int> out;
    while (const auto frame = source.next(Deadline::never())) {
      out.push_back(frame->gray.empty() ? -1 : frame->gray.at(4, 3));
    }
    return out;
  }
};

TEST_F(TumGray, IsTheNearestInTime) {
  auto source = open();
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ(levels(**source), (std::vector<int>{10, 20, -1, 30}));
}

TEST_F(TumGray, IsLeftOutWhenNotWantedNotRegisteredOrNotThere) {
  options_.gray = false;
  EXPECT_EQ(levels(*open().value()), (std::vector<int>{-1, -1, -1, -1}));
  options_.gray = true;
  write_bytes(dir_ / "camera.toml", camera_toml(""));
  EXPECT_EQ(levels(*open().value()), (std::vector<int>{-1, -1, -1, -1}));
  write_bytes(dir_ / "camera.toml", camera_toml("registered_to_colour = true"));
  std::filesystem::remove(dir_ / "rgb.txt");
  EXPECT_EQ(levels(*open().value()), (std::vector<int>{-1, -1, -1, -1}));
}

TEST_F(TumGray, SaysWhyItIsNotUsed) {
  write_bytes(dir_ / "camera.toml", camera_toml(""));
  auto source = open();
  EXPECT_TRUE(says(std::string{(*source)->detail()}, "gray is not used: not registered"));
}

TEST_F(TumGray, OfACameraOfItsOwnComesBesideWithItsOffsetInTime) {
  const std::string gray = fmt::format(
      "[gray]\nwidth_px = {}\nheight_px = {}\nfx_px = 9.0\nfy_px = 9.0\ncx_px = 3.0\n"
      "cy_px = 2.0\nT_depth_gray = [0.025, 0, 0, 0, 0, 0, 1]\n",
      kWidth, kHeight);
  write_bytes(dir_ / "camera.toml", camera_toml(gray));
  auto source = open();
  ASSERT_TRUE(source) << source.error().what;
  const auto frame = (*source)->next(Deadline::never());
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->gray.empty());
  ASSERT_FALSE(frame->gray_beside.pixels.empty());
  EXPECT_EQ(frame->gray_beside.pixels.at(4, 3), 10);
  EXPECT_DOUBLE_EQ(frame->gray_beside.camera.fx_px, 9.0);
  EXPECT_DOUBLE_EQ(frame->gray_beside.T_depth_gray.t.x(), 0.025);
  // Gray is stamped a tenth of a second late: the frame at 0.0 has the image of 0.099.
  write_bytes(dir_ / "camera.toml", camera_toml(gray + "time_offset_s = 0.1\n"));
  auto shifted = open();
  ASSERT_TRUE(shifted);
  EXPECT_EQ((*shifted)->next(Deadline::never())->gray_beside.pixels.at(4, 3), 20);
  write_bytes(dir_ / "camera.toml", camera_toml(gray + "time_offset_s = 5.0\n"));
  auto late = open();
  ASSERT_TRUE(late);
  EXPECT_TRUE((*late)->next(Deadline::never())->gray_beside.pixels.empty());
  write_bytes(dir_ / "camera.toml", camera_toml(gray + "colour = 1\n"));
  EXPECT_TRUE(says(open().error().what, "unknown key gray.colour"));
}

TEST_F(TumGray, GoesMissingWithADamagedImageTheFrameDoesNot) {
  truncate("rgb/20.jpg");
  auto source = open();
  EXPECT_EQ(levels(**source), (std::vector<int>{10, -1, -1, 30}));
  EXPECT_EQ((*source)->counters().read, 4u);
  EXPECT_EQ((*source)->counters().unreadable, 1u);
  EXPECT_TRUE(says(std::string{(*source)->detail()}, "rgb/20.jpg"));
}

TEST_F(TumGray, OfAnotherSizeIsAnError) {
  const std::vector<std::uint8_t> pixels(100);
  ASSERT_TRUE(write_png(dir_ / "rgb/10.png", view(pixels, 10)));
  const std::string what = error();
  EXPECT_TRUE(says(what, "rgb/10.png") && says(what, "10x10") && says(what, "8x6")) << what;
}

TEST(TumRecordings, PlayFromBeginningToEnd) {
  MAPLET_RECORDING(folder, "rgbd/redkitchen_a");
  auto source = TumSource::open(folder, {0, 30, 1}, {});
  ASSERT_TRUE(source) << source.error().what;
  int frames = 0;
  while (const auto frame = (*source)->next(Deadline::never())) {
    ++frames;
    EXPECT_TRUE(frame->gray.empty());  // not registered
    for (int u = 0; u < 640; u += 7) ASSERT_NE(frame->depth.at(u, 240), 65535);
  }
  EXPECT_EQ(frames, 30);
}

TEST(TumRecordings, BringGrayWhereItIsRegistered) {
  MAPLET_RECORDING(folder, "rgbd/fr3_structure_notexture_far");
  auto source = TumSource::open(folder, {0, 10, 1}, {});
  ASSERT_TRUE(source) << source.error().what;
  const auto frame = (*source)->next(Deadline::never());
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->stamp, Stamp{1341836537655691000});
  EXPECT_FALSE(frame->gray.empty());
  EXPECT_EQ(frame->metres_per_unit, 0.0002);
}

}  // namespace
}  // namespace maplet
