// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "core/patches/moments.hpp"

namespace maplet {

/// The image is read in blocks of 8 x 8 pixels.
inline constexpr int kBlockPx = 8;

/// Which raw depths count, and how they become inverse depth in steps.
struct DepthScale {
  std::uint16_t min_raw = 1;
  std::uint16_t max_raw = 65534;  ///< 65535 is saturation, not a distance
  float steps_times_raw = 0.0F;   ///< 1/Z in steps = steps_times_raw / raw

  /// @param metres_per_unit  anything; what is not a positive number gives a scale without pixels
  [[nodiscard]] static DepthScale of(double metres_per_unit) noexcept;
  [[nodiscard]] bool valid(std::uint16_t raw) const noexcept {
    return raw >= min_raw && raw <= max_raw;
  }
};

/// Nearer than this is no depth: keeps 1/Z within 19 bits.
inline constexpr double kNearestM = 0.0625;
/// Differences of 1/Z inside a block are clamped to this many steps (a quarter of 1/m): flat pixels
/// never get there, and sums over a quarter stay within 31 bits.
inline constexpr int kMaxBlockStep = 8191;

/// How many pixels, and sums of their places.
struct PixelCount {
  std::int32_t n = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0;

  /// @param valid  bit 8 v + u of each pixel that counts
  [[nodiscard]] static PixelCount of(std::uint64_t valid) noexcept;
};

/// Integer sums over a block, a quarter at a time; u, v count from the block's top left pixel and w
/// from w0.
struct BlockSums {
  struct Quarter {
    std::int32_t w, uw, vw, ww;
  };
  static constexpr std::uint64_t kAll = ~std::uint64_t{0};

  std::uint64_t valid;  ///< bit 8 v + u
  std::int32_t w0;
  std::array<Quarter, 4> quarters;  ///< top left, top right, bottom left, bottom right

  /// The pixels of a quarter.
  [[nodiscard]] static constexpr std::uint64_t mask(int quarter) noexcept {
    return std::uint64_t{0x0F0F0F0F} << (quarter % 2 * 4 + quarter / 2 * 32);
  }
  [[nodiscard]] int pixels() const noexcept { return std::popcount(valid); }

  /// @param u0, v0    the top left pixel, counted from the image's middle pixel
  /// @param row_step  rows of the block are this far apart
  [[nodiscard]] Moments moments(int u0, int v0, int row_step) const noexcept;
  [[nodiscard]] Moments quarter_moments(int quarter, int u0, int v0, int row_step) const noexcept;
  /// The least-squares plane of a block, or of its quarter, without a hole and with row_step 1: the
  /// same as fit() of its moments, for less.
  [[nodiscard]] Fit full_fit(int u0, int v0) const noexcept;
  [[nodiscard]] Fit full_quarter_fit(int quarter, int u0, int v0) const noexcept;
};

/// Sums `blocks` neighbouring blocks of `rows` <= 8 rows. All variants give the same integers.
using BlockRowFunction = void (*)(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                                  int blocks, const DepthScale& scale, BlockSums* out) noexcept;

/// Any width up to 8: the image's right edge, and the reference for the fast variants.
void sum_block_plain(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int columns, int rows,
                     const DepthScale& scale, BlockSums& out) noexcept;
void sum_blocks_plain(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows, int blocks,
                      const DepthScale& scale, BlockSums* out) noexcept;

struct BlockVariant {
  std::string_view name;
  BlockRowFunction sum;
};
/// What this processor runs, the fastest last.
[[nodiscard]] std::vector<BlockVariant> block_variants();

namespace block {
/// What the differences of a block count from: its middle pixel, or the nearest valid one.
[[nodiscard]] std::int32_t reference(const std::uint16_t* pixels, std::ptrdiff_t stride_px,
                                     int columns, int rows, const DepthScale& scale) noexcept;
void sum_blocks_sse2(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows, int blocks,
                     const DepthScale& scale, BlockSums* out) noexcept;
void sum_blocks_avx2(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows, int blocks,
                     const DepthScale& scale, BlockSums* out) noexcept;
void sum_blocks_neon(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows, int blocks,
                     const DepthScale& scale, BlockSums* out) noexcept;
}  // namespace block

}  // namespace maplet
