// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/kept_depth.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace maplet {
namespace {

constexpr int kWidth = 44;  // no whole number of blocks
constexpr int kHeight = 27;

struct Image {
  std::vector<std::uint16_t> depth =
      std::vector<std::uint16_t>(static_cast<std::size_t>(kWidth) * kHeight);
  DepthFrame frame;

  std::uint16_t& at(int u, int v) { return depth[static_cast<std::size_t>(v * kWidth + u)]; }
  const DepthFrame& view(double metres_per_unit) {
    frame.depth = {depth.data(), kWidth, kHeight, kWidth};
    frame.camera = {kWidth, kHeight, 40.0, 40.0, 22.0, 13.0};
    frame.metres_per_unit = metres_per_unit;
    return frame;
  }
};

TEST(KeptDepth, IsExactWhereDepthsAreNearEachOther) {
  Image image;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      image.at(u, v) = static_cast<std::uint16_t>((u + v) % 5 == 0 ? 0 : 1000 + 12 * u + 18 * v);
    }
  }
  Arena arena;
  KeptDepth kept{{kWidth, kHeight}, arena};
  kept.take(image.view(0.001));
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      EXPECT_FLOAT_EQ(kept.at(u, v), 0.001F * static_cast<float>(image.at(u, v)));
    }
  }
}

TEST(KeptDepth, IsWithinAShareOfWhatABlockSpansAndKnowsNoReturn) {
  std::mt19937 random{3};
  for (const int most : {255, 256, 509, 1016, 8000, 65535}) {
    Image image;
    for (std::uint16_t& d : image.depth) {
      d = static_cast<std::uint16_t>(
          random() % 7 == 0 ? 0 : 1 + random() % static_cast<unsigned>(most));
    }
    Arena arena;
    KeptDepth kept{{kWidth, kHeight}, arena};
    kept.take(image.view(1.0));
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const float d = static_cast<float>(image.at(u, v));
        EXPECT_EQ(kept.at(u, v) == 0.0F, d == 0.0F) << most;
        EXPECT_LE(std::abs(kept.at(u, v) - d), static_cast<float>(most) / 255.0F) << most;
      }
    }
  }
}

TEST(KeptDepth, WhatIsOutsideTheSizeGivenIsNoReturn) {
  Image image;
  image.depth.assign(image.depth.size(), 2000);
  Arena arena;
  KeptDepth kept{{16, 8}, arena};
  kept.take(image.view(0.001));
  EXPECT_FLOAT_EQ(kept.at(15, 7), 2.0F);
  EXPECT_EQ(kept.at(16, 7), 0.0F);
  EXPECT_EQ(kept.at(15, 8), 0.0F);
}

}  // namespace
}  // namespace maplet
