// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/block.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <tuple>

namespace maplet {
namespace {

using Pixels = std::array<std::uint16_t, 24 * 9>;  // 3 blocks, stride 24, a row to spare

auto all_of(const BlockSums& s) {
  return std::tie(s.n, s.u, s.v, s.uu, s.uv, s.vv, s.w, s.uw, s.vw, s.ww, s.w0);
}

void expect_all_variants_equal(const Pixels& pixels, int rows, const DepthScale& scale) {
  std::array<BlockSums, 3> reference;
  sum_blocks_plain(pixels.data(), 24, rows, 3, scale, reference.data());
  for (const BlockVariant& variant : block_variants()) {
    std::array<BlockSums, 3> sums;
    variant.sum(pixels.data(), 24, rows, 3, scale, sums.data());
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(all_of(sums[k]), all_of(reference[k])) << variant.name << " block " << k;
    }
  }
}

TEST(Block, AllVariantsGiveTheSameIntegers) {
  std::mt19937 rng{1};
  for (const double unit : {0.001, 0.0002, 0.005, 1e-6, 1.0}) {
    for (int k = 0; k < 200; ++k) {
      Pixels pixels{};
      const int kind = k % 4;
      for (auto& p : pixels) {
        if (kind == 0) p = static_cast<std::uint16_t>(2000 + rng() % 40);  // flat
        if (kind == 1) p = static_cast<std::uint16_t>(rng());              // noise
        if (kind == 2) p = rng() % 3 == 0 ? 0 : static_cast<std::uint16_t>(900 + rng() % 300);
        if (kind == 3) p = rng() % 2 == 0 ? 65535 : static_cast<std::uint16_t>(1 + rng() % 80);
      }
      expect_all_variants_equal(pixels, 1 + k % 8, DepthScale::of(unit));
    }
  }
}

TEST(Block, ExtremesStayInRange) {
  for (const int value : {0, 1, 62, 63, 64, 32767, 32768, 65534, 65535}) {
    Pixels pixels{};
    pixels.fill(static_cast<std::uint16_t>(value));
    expect_all_variants_equal(pixels, 8, DepthScale::of(0.001));
    pixels[12] = 63;
    pixels[100] = 65534;
    expect_all_variants_equal(pixels, 8, DepthScale::of(0.001));
  }
}

TEST(Block, UnusableUnitHasNoPixels) {
  Pixels pixels{};
  pixels.fill(1000);
  for (const double unit : {0.0, -1.0, std::nan(""), HUGE_VAL, 1e-300}) {
    std::array<BlockSums, 3> sums;
    for (const BlockVariant& variant : block_variants()) {
      variant.sum(pixels.data(), 24, 8, 3, DepthScale::of(unit), sums.data());
      EXPECT_EQ(sums[1].n, 0) << variant.name << " " << unit;
    }
  }
}

TEST(Block, MomentsMoveToTheImagesOrigin) {
  // Two pixels at (3, 5) and (4, 6) of a block at (-16, 8), every second row taken.
  BlockSums sums;
  sums.n = 2, sums.u = 7, sums.v = 11, sums.uu = 25, sums.uv = 39, sums.vv = 61;
  sums.w0 = 100, sums.w = 5, sums.uw = 2 * 3 + 3 * 4, sums.vw = 2 * 5 + 3 * 6, sums.ww = 13;
  const Moments m = sums.moments(-16, 8, 2);
  const double u[] = {-13, -12};
  const double v[] = {18, 20};
  const double w[] = {102, 103};
  EXPECT_EQ(m.u, u[0] + u[1]);
  EXPECT_EQ(m.vv, v[0] * v[0] + v[1] * v[1]);
  EXPECT_EQ(m.uv, u[0] * v[0] + u[1] * v[1]);
  EXPECT_EQ(m.uw, u[0] * w[0] + u[1] * w[1]);
  EXPECT_EQ(m.vw, v[0] * w[0] + v[1] * w[1]);
  EXPECT_EQ(m.ww, w[0] * w[0] + w[1] * w[1]);
}

}  // namespace
}  // namespace maplet
