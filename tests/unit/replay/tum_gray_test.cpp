// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Gray images of recordings; and the real recordings, with what they bring.
#include "tests/support/recordings.hpp"
#include "tests/unit/replay/tum_recording.hpp"

namespace maplet {
namespace {

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
