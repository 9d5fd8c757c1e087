// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/frame/decimator.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

namespace maplet {
namespace {

DepthFrame frame_of(const std::vector<std::uint16_t>& pixels, int width, int height) {
  DepthFrame frame;
  frame.depth = {pixels.data(), width, height, width};
  frame.camera = {width, height, 500.0, 500.0, width / 2.0, height / 2.0};
  return frame;
}

TEST(Decimator, KeepsEveryOtherPixelAndItsRay) {
  std::vector<std::uint16_t> pixels(7 * 5);
  std::iota(pixels.begin(), pixels.end(), std::uint16_t{1});
  const DepthFrame full = frame_of(pixels, 7, 5);
  Arena arena;
  Decimator decimator{{2}, arena};
  const DepthFrame half = decimator.run(full);
  ASSERT_EQ(half.depth.width_px, 4);
  ASSERT_EQ(half.depth.height_px, 3);
  EXPECT_EQ(half.camera.width_px, 4);
  for (int v = 0; v < 3; ++v) {
    for (int u = 0; u < 4; ++u) {
      EXPECT_EQ(half.depth.at(u, v), full.depth.at(2 * u, 2 * v));
      EXPECT_LT((half.camera.ray(u, v) - full.camera.ray(2 * u, 2 * v)).norm(), 1e-12);
    }
  }
}

TEST(Decimator, StepOneIsTheFrameItself) {
  const std::vector<std::uint16_t> pixels(6, 9);
  Arena arena;
  Decimator decimator{{1}, arena};
  EXPECT_EQ(decimator.run(frame_of(pixels, 3, 2)).depth.pixels, pixels.data());
  EXPECT_EQ(arena.used_bytes(), 0u);
}

TEST(Decimator, RefusesWhatItHasNoRoomFor) {
  const std::vector<std::uint16_t> pixels(1, 9);
  DepthFrame frame = frame_of(pixels, 1, 1);
  frame.depth.width_px = 100000;
  frame.depth.height_px = 100000;
  frame.depth.stride_px = 0;
  Arena arena;
  Decimator decimator{{2}, arena};
  EXPECT_TRUE(decimator.run(frame).depth.empty());
}

}  // namespace
}  // namespace maplet
