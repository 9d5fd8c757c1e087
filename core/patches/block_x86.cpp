// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The block sums for SSE2 and AVX2. Only functions here carry a target, and none touches Eigen.
#if defined(__x86_64__) || defined(__i386__)
#include <immintrin.h>

#include "core/patches/block.hpp"

namespace maplet::block {

namespace {

#define MAPLET_SSE2 __attribute__((target("sse2")))
#define MAPLET_AVX2 __attribute__((target("avx2")))

MAPLET_SSE2 inline __m128i load(const std::uint16_t* pixels) noexcept {
  return _mm_loadu_si128(reinterpret_cast<const __m128i*>(pixels));
}

/// 0xFFFF where a pixel counts: min_raw <= raw < 65535.
MAPLET_SSE2 inline __m128i valid_mask(__m128i raw, __m128i min_raw) noexcept {
  const __m128i far_enough = _mm_cmpeq_epi16(_mm_subs_epu16(min_raw, raw), _mm_setzero_si128());
  const __m128i saturated = _mm_cmpeq_epi16(raw, _mm_set1_epi16(-1));
  return _mm_andnot_si128(saturated, far_enough);
}

/// The valid pixels of a block, bit 8 v + u.
MAPLET_SSE2 inline std::uint64_t valid_bits(const std::uint16_t* pixels, std::ptrdiff_t stride_px,
                                            int rows, __m128i min_raw) noexcept {
  std::uint64_t out = 0;
  for (int v = 0; v < rows; ++v) {
    const __m128i mask = valid_mask(load(pixels + v * stride_px), min_raw);
    const int bits = _mm_movemask_epi8(_mm_packs_epi16(mask, _mm_setzero_si128()));
    out |= static_cast<std::uint64_t>(bits) << (8 * v);
  }
  return out;
}

/// Sums of the four lanes of each: a transposition and three additions.
MAPLET_SSE2 inline __m128i lane_sums(__m128i a, __m128i b, __m128i c, __m128i d) noexcept {
  const __m128i ab_low = _mm_unpacklo_epi32(a, b), ab_high = _mm_unpackhi_epi32(a, b);
  const __m128i cd_low = _mm_unpacklo_epi32(c, d), cd_high = _mm_unpackhi_epi32(c, d);
  const __m128i ab = _mm_add_epi32(ab_low, ab_high);
  const __m128i cd = _mm_add_epi32(cd_low, cd_high);
  return _mm_add_epi32(_mm_unpacklo_epi64(ab, cd), _mm_unpackhi_epi64(ab, cd));
}

MAPLET_SSE2 void sum_block(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                           const DepthScale& scale, BlockSums& out) noexcept {
  out = {};
  const __m128i min_raw = _mm_set1_epi16(static_cast<short>(scale.min_raw));
  if (scale.max_raw < scale.min_raw) return;
  out.valid = valid_bits(pixels, stride_px, rows, min_raw);
  if (out.valid == 0) return;
  out.w0 = reference(pixels, stride_px, kBlockPx, rows, scale);
  const __m128i w0 = _mm_set1_epi32(out.w0);
  const __m128 steps = _mm_set1_ps(scale.steps_times_raw);
  const __m128i limit = _mm_set1_epi16(kMaxBlockStep);
  const __m128i ones = _mm_set1_epi16(1);
  const __m128i zero = _mm_setzero_si128();
  // Two rows at a time, so that a register holds four pixels of each: all of one quarter.
  const __m128i us[2] = {_mm_setr_epi16(0, 1, 2, 3, 0, 1, 2, 3),
                         _mm_setr_epi16(4, 5, 6, 7, 4, 5, 6, 7)};
  __m128i vs = _mm_setr_epi16(0, 0, 0, 0, 1, 1, 1, 1);
  __m128i sums[2][4] = {};
  for (int v = 0; v < rows; v += 2) {
    const __m128i first = load(pixels + v * stride_px);
    const __m128i second = v + 1 < rows ? load(pixels + (v + 1) * stride_px) : zero;
    const __m128i mask_first = valid_mask(first, min_raw);
    const __m128i mask_second = valid_mask(second, min_raw);
    for (int side = 0; side < 2; ++side) {
      const auto half = [&](__m128i raw) MAPLET_SSE2 {
        const __m128i wide =
            side == 0 ? _mm_unpacklo_epi16(raw, zero) : _mm_unpackhi_epi16(raw, zero);
        return _mm_sub_epi32(_mm_cvtps_epi32(_mm_div_ps(steps, _mm_cvtepi32_ps(wide))), w0);
      };
      __m128i d = _mm_packs_epi32(half(first), half(second));
      d = _mm_max_epi16(_mm_min_epi16(d, limit), _mm_sub_epi16(zero, limit));
      d = _mm_and_si128(d, side == 0 ? _mm_unpacklo_epi64(mask_first, mask_second)
                                     : _mm_unpackhi_epi64(mask_first, mask_second));
      sums[side][0] = _mm_add_epi32(sums[side][0], _mm_madd_epi16(d, ones));
      sums[side][1] = _mm_add_epi32(sums[side][1], _mm_madd_epi16(d, us[side]));
      sums[side][2] = _mm_add_epi32(sums[side][2], _mm_madd_epi16(d, vs));
      sums[side][3] = _mm_add_epi32(sums[side][3], _mm_madd_epi16(d, d));
    }
    vs = _mm_add_epi16(vs, _mm_set1_epi16(2));
    if (v != 2 && v + 2 < rows) continue;
    const std::size_t first_quarter = v <= 2 ? 0 : 2;
    for (std::size_t side = 0; side < 2; ++side) {
      const __m128i q = lane_sums(sums[side][0], sums[side][1], sums[side][2], sums[side][3]);
      _mm_storeu_si128(reinterpret_cast<__m128i*>(&out.quarters[first_quarter + side]), q);
      for (__m128i& sum : sums[side]) sum = zero;
    }
  }
}

/// Validity of four rows at once, and what the middle pixel stands in for when it has no depth.
struct Rows {
  __m256i raw[4];  ///< two rows each, [row | next row]
};

MAPLET_AVX2 inline Rows load_rows(const std::uint16_t* pixels, std::ptrdiff_t stride_px,
                                  int rows) noexcept {
  Rows out;
  for (int k = 0; k < 4; ++k) {
    const __m128i first = 2 * k < rows ? load(pixels + 2 * k * stride_px) : _mm_setzero_si128();
    const __m128i second =
        2 * k + 1 < rows ? load(pixels + (2 * k + 1) * stride_px) : _mm_setzero_si128();
    out.raw[k] = _mm256_setr_m128i(first, second);
  }
  return out;
}

MAPLET_AVX2 inline __m256i valid_rows(__m256i raw, __m256i min_raw) noexcept {
  const __m256i far_enough =
      _mm256_cmpeq_epi16(_mm256_subs_epu16(min_raw, raw), _mm256_setzero_si256());
  return _mm256_andnot_si256(_mm256_cmpeq_epi16(raw, _mm256_set1_epi16(-1)), far_enough);
}

/// Bits of four rows from two masks of two rows each.
MAPLET_AVX2 inline std::uint64_t bits_of(__m256i rows_01, __m256i rows_23) noexcept {
  // packs works within lanes: bytes come as rows 0, 2, 1, 3 and go back in order.
  const __m256i packed =
      _mm256_permute4x64_epi64(_mm256_packs_epi16(rows_01, rows_23), _MM_SHUFFLE(3, 1, 2, 0));
  return static_cast<std::uint32_t>(_mm256_movemask_epi8(packed));
}

/// The sums of one half of a block: four rows, left lane and right lane.
MAPLET_AVX2 inline __m256i sum_half(const __m256i* raw, const __m256i* mask, __m256 steps,
                                    __m256i w0, int first_row) noexcept {
  const __m256i us = _mm256_setr_epi16(0, 1, 2, 3, 0, 1, 2, 3, 4, 5, 6, 7, 4, 5, 6, 7);
  const __m256i ones = _mm256_set1_epi16(1);
  const __m256i limit = _mm256_set1_epi16(kMaxBlockStep);
  const __m256i least = _mm256_set1_epi16(-kMaxBlockStep);
  const __m256i next = _mm256_setr_epi16(0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0, 1, 1, 1, 1);
  __m256i sum[2][4];
  for (int k = 0; k < 2; ++k) {
    const auto w_of = [&](__m128i row) MAPLET_AVX2 {
      const __m256 z = _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(row));
      return _mm256_sub_epi32(_mm256_cvtps_epi32(_mm256_div_ps(steps, z)), w0);
    };
    __m256i d = _mm256_packs_epi32(w_of(_mm256_castsi256_si128(raw[k])),
                                   w_of(_mm256_extracti128_si256(raw[k], 1)));
    d = _mm256_max_epi16(_mm256_min_epi16(d, limit), least);
    d = _mm256_and_si256(d, _mm256_permute4x64_epi64(mask[k], _MM_SHUFFLE(3, 1, 2, 0)));
    const __m256i vs =
        _mm256_add_epi16(next, _mm256_set1_epi16(static_cast<short>(first_row + 2 * k)));
    sum[k][0] = _mm256_madd_epi16(d, ones);
    sum[k][1] = _mm256_madd_epi16(d, us);
    sum[k][2] = _mm256_madd_epi16(d, vs);
    sum[k][3] = _mm256_madd_epi16(d, d);
  }
  const auto both = [&](int i) MAPLET_AVX2 { return _mm256_add_epi32(sum[0][i], sum[1][i]); };
  return _mm256_hadd_epi32(_mm256_hadd_epi32(both(0), both(1)),
                           _mm256_hadd_epi32(both(2), both(3)));
}

MAPLET_AVX2 inline void sum_block_avx2(const std::uint16_t* pixels, std::ptrdiff_t stride_px,
                                       int rows, const DepthScale& scale, BlockSums& out) noexcept {
  const Rows in = load_rows(pixels, stride_px, rows);
  const __m256i min_raw = _mm256_set1_epi16(static_cast<short>(scale.min_raw));
  __m256i mask[4];
  for (int k = 0; k < 4; ++k) mask[k] = valid_rows(in.raw[k], min_raw);
  out.valid = bits_of(mask[0], mask[1]) | bits_of(mask[2], mask[3]) << 32;
  if (out.valid == 0) {
    out = {};
    return;
  }
  std::uint16_t at = pixels[rows / 2 * stride_px + kBlockPx / 2];
  if (!scale.valid(at)) {
    __m256i nearest = _mm256_set1_epi16(-1);
    for (int k = 0; k < 4; ++k) {
      const __m256i invalid = _mm256_xor_si256(mask[k], _mm256_set1_epi16(-1));
      nearest = _mm256_min_epu16(nearest, _mm256_or_si256(in.raw[k], invalid));
    }
    const __m128i eight =
        _mm_min_epu16(_mm256_castsi256_si128(nearest), _mm256_extracti128_si256(nearest, 1));
    at = static_cast<std::uint16_t>(_mm_cvtsi128_si32(_mm_minpos_epu16(eight)));
  }
  out.w0 = _mm_cvtss_si32(_mm_set_ss(scale.steps_times_raw / static_cast<float>(at)));
  const __m256 steps = _mm256_set1_ps(scale.steps_times_raw);
  const __m256i w0 = _mm256_set1_epi32(out.w0);
  auto* quarters = reinterpret_cast<__m256i*>(out.quarters.data());
  _mm256_storeu_si256(quarters, sum_half(in.raw, mask, steps, w0, 0));
  _mm256_storeu_si256(quarters + 1, sum_half(in.raw + 2, mask + 2, steps, w0, 4));
}

}  // namespace

MAPLET_SSE2 void sum_blocks_sse2(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                                 int blocks, const DepthScale& scale, BlockSums* out) noexcept {
  for (int i = 0; i < blocks; ++i) {
    sum_block(pixels + i * kBlockPx, stride_px, rows, scale, out[i]);
  }
}

MAPLET_AVX2 void sum_blocks_avx2(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                                 int blocks, const DepthScale& scale, BlockSums* out) noexcept {
  const bool any = scale.max_raw >= scale.min_raw;
  for (int i = 0; i < blocks; ++i) {
    if (any) {
      sum_block_avx2(pixels + i * kBlockPx, stride_px, rows, scale, out[i]);
    } else {
      out[i] = {};
    }
  }
}

}  // namespace maplet::block
#endif
