// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/image_file.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <random>

#include "tests/support/recordings.hpp"
#include "tests/unit/replay/images.hpp"

namespace maplet {
namespace {

using test::read_bytes;
using test::TempDir;
using test::view;
using test::write_bytes;

constexpr int kWidth = 31;  // odd: no row ends on a machine word
constexpr int kHeight = 17;
constexpr ImageSize kSize{kWidth, kHeight};

std::vector<std::uint16_t> random_depth() {
  std::mt19937 random{7};
  std::vector<std::uint16_t> pixels(kSize.pixels());
  for (auto& pixel : pixels) pixel = static_cast<std::uint16_t>(random());
  return pixels;
}

std::vector<std::uint8_t> flat_colour(std::uint8_t r, std::uint8_t g, std::uint8_t b) {
  std::vector<std::uint8_t> rgb;
  for (std::size_t i = 0; i < kSize.pixels(); ++i) rgb.insert(rgb.end(), {r, g, b});
  return rgb;
}

bool says(const ImageError& error, std::string_view part) {
  return std::string_view{error.what.data(), error.what.size()}.find(part) !=
         std::string_view::npos;
}

class ImageFile : public testing::Test {
 protected:
  TempDir dir_;
  ImageReader reader_;
  std::vector<std::uint16_t> depth_ = std::vector<std::uint16_t>(kSize.pixels());
  std::vector<std::uint8_t> gray_ = std::vector<std::uint8_t>(kSize.pixels());
};

TEST_F(ImageFile, SixteenBitsComeBackExactly) {
  const auto pixels = random_depth();
  ASSERT_TRUE(write_png(dir_ / "d.png", view(pixels, kWidth)));
  const auto got = reader_.read_depth(dir_ / "d.png", kSize, depth_);
  ASSERT_TRUE(got) << got.error().what;
  EXPECT_EQ(depth_, pixels);
  EXPECT_EQ(reader_.read_size(dir_ / "d.png").value(), kSize);
}

TEST_F(ImageFile, EightBitsComeBackExactly) {
  std::vector<std::uint8_t> pixels(kSize.pixels());
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<std::uint8_t>(i * 37);
  ASSERT_TRUE(write_png(dir_ / "g.png", view(pixels, kWidth)));
  ASSERT_TRUE(reader_.read_gray(dir_ / "g.png", kSize, gray_));
  EXPECT_EQ(gray_, pixels);
}

TEST_F(ImageFile, WritesRowsOfALargerImage) {
  const auto pixels = random_depth();
  const ImageView<std::uint16_t> part{pixels.data() + 2 * kWidth + 3, 5, 4, kWidth};
  ASSERT_TRUE(write_png(dir_ / "part.png", part));
  ASSERT_TRUE(reader_.read_depth(dir_ / "part.png", {5, 4}, depth_));
  for (int v = 0; v < 4; ++v) {
    for (int u = 0; u < 5; ++u) EXPECT_EQ(depth_[v * 5 + u], part.at(u, v));
  }
}

TEST_F(ImageFile, ColourBecomesLumaFromPngAndJpegAlike) {
  const auto rgb = flat_colour(200, 100, 50);
  const int luma = 124;  // 0.299 * 200 + 0.587 * 100 + 0.114 * 50
  test::write_colour_png(dir_ / "c.png", kWidth, kHeight, rgb);
  test::write_jpeg(dir_ / "c.jpg", kWidth, kHeight, rgb);
  for (const char* name : {"c.png", "c.jpg"}) {
    const auto got = reader_.read_gray(dir_ / name, kSize, gray_);
    ASSERT_TRUE(got) << got.error().what;
    for (const auto pixel : gray_) ASSERT_NEAR(pixel, luma, 1) << name;
  }
}

TEST_F(ImageFile, NamesBothSizes) {
  ASSERT_TRUE(write_png(dir_ / "d.png", view(random_depth(), kWidth)));
  const auto got = reader_.read_depth(dir_ / "d.png", {17, 31}, depth_);
  ASSERT_FALSE(got);
  EXPECT_TRUE(says(got.error(), "d.png") && says(got.error(), "31x17") &&
              says(got.error(), "17x31"))
      << got.error().what;
}

TEST_F(ImageFile, RefusesDepthOfEightBits) {
  ASSERT_TRUE(write_png(dir_ / "g.png", view(gray_, kWidth)));
  const auto got = reader_.read_depth(dir_ / "g.png", kSize, depth_);
  ASSERT_FALSE(got);
  EXPECT_TRUE(says(got.error(), "8-bit gray") && says(got.error(), "16-bit")) << got.error().what;
}

TEST_F(ImageFile, RefusesEveryTruncationOfAPng) {
  ASSERT_TRUE(write_png(dir_ / "d.png", view(random_depth(), kWidth)));
  const std::string whole = read_bytes(dir_ / "d.png");
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto part = std::as_bytes(std::span{whole}.first(size));
    const auto got = reader_.decode_depth(part, "part.png", kSize, depth_);
    ASSERT_FALSE(got) << size;
    ASSERT_TRUE(says(got.error(), "part.png")) << got.error().what;
  }
  ASSERT_TRUE(reader_.decode_depth(std::as_bytes(std::span{whole}), "whole.png", kSize, depth_));
}

TEST_F(ImageFile, RefusesATruncatedJpeg) {
  test::write_jpeg(dir_ / "c.jpg", kWidth, kHeight, flat_colour(9, 99, 199));
  const std::string whole = read_bytes(dir_ / "c.jpg");
  write_bytes(dir_ / "half.jpg", whole.substr(0, whole.size() - 20));
  const auto got = reader_.read_gray(dir_ / "half.jpg", kSize, gray_);
  ASSERT_FALSE(got);
  EXPECT_TRUE(says(got.error(), "half.jpg") && says(got.error(), "damaged")) << got.error().what;
}

TEST_F(ImageFile, RefusesAJpegCutOffInItsHeader) {
  test::write_jpeg(dir_ / "c.jpg", kWidth, kHeight, flat_colour(9, 99, 199));
  const std::string whole = read_bytes(dir_ / "c.jpg");
  for (std::size_t size = 2; size < 100; ++size) {
    const auto got = reader_.decode_size(std::as_bytes(std::span{whole}.first(size)), "part.jpg");
    ASSERT_FALSE(got) << size;
  }
}

TEST_F(ImageFile, DamagedBytesNeverCrash) {
  ASSERT_TRUE(write_png(dir_ / "d.png", view(random_depth(), kWidth)));
  test::write_jpeg(dir_ / "c.jpg", kWidth, kHeight, flat_colour(9, 99, 199));
  std::mt19937 random{11};
  for (const char* name : {"d.png", "c.jpg"}) {
    const std::string whole = read_bytes(dir_ / name);
    int refused = 0;
    for (int round = 0; round < 400; ++round) {
      std::string bytes = whole;
      for (int i = 0; i < 4; ++i) bytes[random() % bytes.size()] = static_cast<char>(random());
      const auto raw = std::as_bytes(std::span{bytes});
      refused += !reader_.decode_depth(raw, name, kSize, depth_);
      (void)reader_.decode_gray(raw, name, kSize, gray_);
    }
    EXPECT_GT(refused, 390) << name;  // a checksum covers nearly every byte
  }
}

TEST_F(ImageFile, ChecksSizesBeforeAnythingGrows) {
  ASSERT_TRUE(write_png(dir_ / "d.png", view(random_depth(), kWidth)));
  std::string bytes = read_bytes(dir_ / "d.png");
  bytes.replace(16, 8, std::string{"\x40\x00\x00\x00\x40\x00\x00\x00", 8});
  const auto got = reader_.decode_size(std::as_bytes(std::span{bytes}), "huge.png");
  ASSERT_FALSE(got);
  EXPECT_TRUE(says(got.error(), "1073741824x1073741824")) << got.error().what;
}

TEST_F(ImageFile, NamesWhatIsNotAFile) {
  for (const char* name : {"missing.png", "folder", "pipe"}) {
    if (std::string_view{name} == "folder") std::filesystem::create_directory(dir_ / name);
    if (std::string_view{name} == "pipe") mkfifo((dir_ / name).c_str(), 0600);
    const auto got = reader_.read_depth(dir_ / name, kSize, depth_);
    ASSERT_FALSE(got);
    EXPECT_EQ(got.error().code, ErrorCode::kIo);
    EXPECT_TRUE(says(got.error(), name)) << got.error().what;
  }
  write_bytes(dir_ / "empty.png", "");
  EXPECT_TRUE(says(reader_.read_depth(dir_ / "empty.png", kSize, depth_).error(), "empty"));
  write_bytes(dir_ / "text.png", "not an image at all, but long enough");
  EXPECT_TRUE(says(reader_.read_depth(dir_ / "text.png", kSize, depth_).error(), "not a PNG"));
  EXPECT_FALSE(write_png(dir_ / "missing/d.png", view(depth_, kWidth)));
}

TEST_F(ImageFile, ReadsARealRecording) {
  MAPLET_RECORDING(recording, "rgbd/redkitchen_a");
  constexpr ImageSize kVga{640, 480};
  std::vector<std::uint16_t> depth(kVga.pixels());
  const auto got = reader_.read_depth(recording / "depth/000000.png", kVga, depth);
  ASSERT_TRUE(got) << got.error().what;
  const auto in_room =
      std::count_if(depth.begin(), depth.end(), [](auto mm) { return mm > 400 && mm < 8000; });
  EXPECT_GT(in_room, 640 * 480 / 2);
  std::vector<std::uint8_t> gray(kVga.pixels());
  ASSERT_TRUE(reader_.read_gray(recording / "rgb/000000.jpg", kVga, gray));
  EXPECT_GT(*std::max_element(gray.begin(), gray.end()), 150);
}

}  // namespace
}  // namespace maplet
