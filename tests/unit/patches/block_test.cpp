// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/block.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

namespace maplet {
namespace {

using Pixels = std::array<std::uint16_t, 24 * 9>;  // 3 blocks, stride 24, a row to spare

std::vector<std::uint64_t> all_of(const BlockSums& s) {
  std::vector<std::uint64_t> out{s.valid, static_cast<std::uint32_t>(s.w0)};
  for (const BlockSums::Quarter& q : s.quarters) {
    for (const int x : {q.w, q.uw, q.vw, q.ww}) out.push_back(static_cast<std::uint32_t>(x));
  }
  return out;
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
      EXPECT_EQ(sums[1].valid, 0u) << variant.name << " " << unit;
    }
  }
}

/// What moments() says, pixel by pixel.
Moments by_hand(const Pixels& pixels, const DepthScale& scale, int rows, int u0, int v0, int step,
                int quarter) {
  Moments m;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < kBlockPx; ++x) {
      const std::uint16_t raw = pixels[static_cast<std::size_t>(y * 24 + x)];
      if (!scale.valid(raw) || (quarter >= 0 && y / 4 * 2 + x / 4 != quarter)) continue;
      const double u = u0 + x, v = v0 + y * step;
      const double w = std::nearbyintf(scale.steps_times_raw / static_cast<float>(raw));
      m += {1.0, u, v, w, u * u, u * v, v * v, u * w, v * w, w * w};
    }
  }
  return m;
}

void expect_equal(const Moments& a, const Moments& b) {
  const auto all = [](const Moments& m) {
    return std::array{m.n, m.u, m.v, m.w, m.uu, m.uv, m.vv, m.uw, m.vw, m.ww};
  };
  EXPECT_EQ(all(a), all(b));
}

TEST(Block, MomentsMoveToTheImagesOrigin) {
  std::mt19937 rng{2};
  const DepthScale scale = DepthScale::of(0.001);
  for (const bool holes : {false, true}) {
    Pixels pixels{};
    for (auto& p : pixels) {
      p = holes && rng() % 4 == 0 ? 0 : static_cast<std::uint16_t>(1900 + rng() % 300);
    }
    for (const int step : {1, 2}) {
      BlockSums sums;
      sum_blocks_plain(pixels.data(), 24, 7, 1, scale, &sums);
      expect_equal(sums.moments(-16, 8, step), by_hand(pixels, scale, 7, -16, 8, step, -1));
      sum_blocks_plain(pixels.data(), 24, 8, 1, scale, &sums);
      expect_equal(sums.moments(-16, 8, step), by_hand(pixels, scale, 8, -16, 8, step, -1));
      for (int q = 0; q < 4; ++q) {
        expect_equal(sums.quarter_moments(q, 40, -24, step),
                     by_hand(pixels, scale, 8, 40, -24, step, q));
      }
    }
  }
}

TEST(Block, ResidualOfAFullBlockIsThatOfTheFit) {
  std::mt19937 rng{3};
  for (int k = 0; k < 50; ++k) {
    Pixels pixels{};
    for (auto& p : pixels) p = static_cast<std::uint16_t>(1500 + rng() % (k + 1));
    BlockSums sums;
    sum_blocks_plain(pixels.data(), 24, 8, 1, DepthScale::of(0.001), &sums);
    const double rss = fit(sums.moments(0, 0, 1)).rss;
    EXPECT_NEAR(sums.full_fit(0, 0).rss, rss, 1e-6 * rss + 1e-3);
  }
}

/// Sums of squares at the clamp's limit do not wrap round.
TEST(Block, LargestDifferencesDoNotOverflow) {
  Pixels pixels{};
  for (std::size_t k = 0; k < pixels.size(); ++k) pixels[k] = k % 2 == 0 ? 63 : 65534;
  for (const BlockVariant& variant : block_variants()) {
    BlockSums sums;
    variant.sum(pixels.data(), 24, 8, 1, DepthScale::of(0.001), &sums);
    EXPECT_GT(fit(sums.moments(0, 0, 1)).rss, 1e8) << variant.name;
  }
}

}  // namespace
}  // namespace maplet
