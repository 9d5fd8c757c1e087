// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tests/unit/replay/tum_recording.hpp"

namespace maplet {
namespace {

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

}  // namespace
}  // namespace maplet
