// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/libcamera/luma.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <numeric>
#include <vector>

namespace maplet::camera {
namespace {

std::uint32_t fourcc(const char* name) {
  std::uint32_t code = 0;
  std::memcpy(&code, name, 4);
  return code;
}

TEST(Luma, KnowsEveryYuvFormat) {
  for (const char* planar : {"NV12", "NV21", "NV16", "NV24", "YU12", "YV12", "YU16", "R8  "}) {
    const auto layout = luma_layout(fourcc(planar));
    ASSERT_TRUE(layout) << planar;
    EXPECT_EQ(layout->first, 0u);
    EXPECT_EQ(layout->step, 1u);
  }
  EXPECT_EQ(luma_layout(fourcc("YUYV"))->step, 2u);
  EXPECT_EQ(luma_layout(fourcc("YUYV"))->first, 0u);
  EXPECT_EQ(luma_layout(fourcc("UYVY"))->first, 1u);
  for (const char* other : {"MJPG", "BA81", "XR24"}) EXPECT_FALSE(luma_layout(fourcc(other)));
}

TEST(Luma, TakesTheRowsOfAPaddedPlane) {
  std::vector<std::uint8_t> plane(10 * 3);  // 8 pixels, rows of 10 bytes
  std::iota(plane.begin(), plane.end(), std::uint8_t{0});
  std::vector<std::uint8_t> out(8 * 3);
  ASSERT_TRUE(copy_luma({plane, 10, 8, 3}, {0, 1}, out));
  for (std::size_t v = 0; v < 3; ++v) {
    for (std::size_t u = 0; u < 8; ++u) EXPECT_EQ(out[8 * v + u], 10 * v + u);
  }
}

TEST(Luma, TakesEverySecondByteOfAPackedFormat) {
  std::vector<std::uint8_t> plane(16 * 2);
  std::iota(plane.begin(), plane.end(), std::uint8_t{0});
  std::vector<std::uint8_t> out(8 * 2);
  for (const std::size_t first : {0u, 1u}) {
    ASSERT_TRUE(copy_luma({plane, 16, 8, 2}, {first, 2}, out));
    for (std::size_t i = 0; i < out.size(); ++i) EXPECT_EQ(out[i], 2 * i + first);
  }
}

TEST(Luma, MixesColoursOfEitherOrder) {
  const std::vector<std::uint8_t> plane{255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255};
  std::vector<std::uint8_t> out(4);
  ASSERT_TRUE(copy_luma({plane, 12, 4, 1}, *luma_layout(fourcc("BG24")), out));  // bytes R, G, B
  EXPECT_EQ(out, (std::vector<std::uint8_t>{76, 150, 29, 255}));
  ASSERT_TRUE(copy_luma({plane, 12, 4, 1}, *luma_layout(fourcc("RG24")), out));
  EXPECT_EQ(out, (std::vector<std::uint8_t>{29, 150, 76, 255}));
  EXPECT_FALSE(
      copy_luma({std::span{plane}.first(11), 12, 4, 1}, *luma_layout(fourcc("RG24")), out));
}

TEST(Luma, RefusesWhatHoldsLessThanItSays) {
  const std::vector<std::uint8_t> plane(10 * 2 + 8);  // the last row may be short of its padding
  std::vector<std::uint8_t> out(8 * 3);
  EXPECT_TRUE(copy_luma({plane, 10, 8, 3}, {0, 1}, out));
  EXPECT_FALSE(copy_luma({std::span{plane}.first(plane.size() - 1), 10, 8, 3}, {0, 1}, out));
  EXPECT_FALSE(copy_luma({plane, 7, 8, 3}, {0, 1}, out));
  EXPECT_FALSE(copy_luma({plane, 10, 8, 3}, {0, 2}, out));
  EXPECT_FALSE(copy_luma({plane, 10, 0, 3}, {0, 1}, out));
  EXPECT_FALSE(copy_luma({plane, 10, 8, 3}, {0, 1}, std::span{out}.first(23)));
}

}  // namespace
}  // namespace maplet::camera
