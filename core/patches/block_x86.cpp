// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The block sums for SSE2 and AVX2. Only functions here carry a target, and none touches Eigen.
#if defined(__x86_64__) || defined(__i386__)
#include <immintrin.h>

#include "core/patches/block.hpp"
#include "core/patches/block_count.hpp"

namespace maplet::block {

namespace {

#define MAPLET_SSE2 __attribute__((target("sse2")))
#define MAPLET_AVX2 __attribute__((target("avx2")))

/// 0xFFFF where a pixel counts: min_raw <= raw < 65535.
MAPLET_SSE2 inline __m128i valid_mask(__m128i raw, __m128i min_raw) noexcept {
  const __m128i far_enough = _mm_cmpeq_epi16(_mm_subs_epu16(min_raw, raw), _mm_setzero_si128());
  const __m128i saturated = _mm_cmpeq_epi16(raw, _mm_set1_epi16(-1));
  return _mm_andnot_si128(saturated, far_enough);
}

MAPLET_SSE2 inline __m128i load(const std::uint16_t* pixels) noexcept {
  return _mm_loadu_si128(reinterpret_cast<const __m128i*>(pixels));
}

MAPLET_SSE2 inline std::int32_t sum(__m128i x) noexcept {
  x = _mm_add_epi32(x, _mm_shuffle_epi32(x, _MM_SHUFFLE(1, 0, 3, 2)));
  x = _mm_add_epi32(x, _mm_shuffle_epi32(x, _MM_SHUFFLE(2, 3, 0, 1)));
  return _mm_cvtsi128_si32(x);
}

/// Counts the valid pixels. @return false when there are none
MAPLET_SSE2 inline bool count(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                              __m128i min_raw, BlockSums& out) noexcept {
  __m128i all = _mm_set1_epi16(-1);
  for (int v = 0; v < rows; ++v) {
    all = _mm_and_si128(all, valid_mask(load(pixels + v * stride_px), min_raw));
  }
  if (rows == kBlockPx && _mm_movemask_epi8(all) == 0xFFFF) {
    count_full(out);
    return true;
  }
  for (int v = 0; v < rows; ++v) {
    const __m128i mask = valid_mask(load(pixels + v * stride_px), min_raw);
    const int bits = _mm_movemask_epi8(_mm_packs_epi16(mask, _mm_setzero_si128()));
    count_row(static_cast<unsigned>(bits), v, out);
  }
  return out.n > 0;
}

/// Saturates to kMaxBlockStep and zeroes what does not count.
MAPLET_SSE2 inline __m128i clamped(__m128i d, __m128i mask) noexcept {
  d = _mm_min_epi16(d, _mm_set1_epi16(kMaxBlockStep));
  d = _mm_max_epi16(d, _mm_set1_epi16(-kMaxBlockStep));
  return _mm_and_si128(d, mask);
}

MAPLET_SSE2 void sum_block(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                           const DepthScale& scale, BlockSums& out) noexcept {
  out = {};
  const __m128i min_raw = _mm_set1_epi16(static_cast<short>(scale.min_raw));
  if (scale.max_raw < scale.min_raw || !count(pixels, stride_px, rows, min_raw, out)) return;
  out.w0 = reference(pixels, stride_px, kBlockPx, rows, scale);
  const __m128i w0 = _mm_set1_epi32(out.w0);
  const __m128 steps = _mm_set1_ps(scale.steps_times_raw);
  const __m128i us = _mm_setr_epi16(0, 1, 2, 3, 4, 5, 6, 7);
  const __m128i ones = _mm_set1_epi16(1);
  const __m128i zero = _mm_setzero_si128();
  __m128i sw = zero, suw = zero, svw = zero, sww = zero, vs = zero;
  for (int v = 0; v < rows; ++v) {
    const __m128i raw = load(pixels + v * stride_px);
    const __m128 low = _mm_div_ps(steps, _mm_cvtepi32_ps(_mm_unpacklo_epi16(raw, zero)));
    const __m128 high = _mm_div_ps(steps, _mm_cvtepi32_ps(_mm_unpackhi_epi16(raw, zero)));
    const __m128i packed = _mm_packs_epi32(_mm_sub_epi32(_mm_cvtps_epi32(low), w0),
                                           _mm_sub_epi32(_mm_cvtps_epi32(high), w0));
    const __m128i d = clamped(packed, valid_mask(raw, min_raw));
    sw = _mm_add_epi32(sw, _mm_madd_epi16(d, ones));
    suw = _mm_add_epi32(suw, _mm_madd_epi16(d, us));
    svw = _mm_add_epi32(svw, _mm_madd_epi16(d, vs));
    sww = _mm_add_epi32(sww, _mm_madd_epi16(d, d));
    vs = _mm_add_epi16(vs, ones);
  }
  out.w = sum(sw);
  out.uw = sum(suw);
  out.vw = sum(svw);
  out.ww = sum(sww);
}

MAPLET_AVX2 inline __m128i halves(__m256i x) noexcept {
  return _mm_add_epi32(_mm256_castsi256_si128(x), _mm256_extracti128_si256(x, 1));
}

/// Two rows at a time; a register holds their left halves and then their right halves.
MAPLET_AVX2 void sum_block_avx2(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                                const DepthScale& scale, BlockSums& out) noexcept {
  out = {};
  const __m128i min_raw = _mm_set1_epi16(static_cast<short>(scale.min_raw));
  if (scale.max_raw < scale.min_raw || !count(pixels, stride_px, rows, min_raw, out)) return;
  out.w0 = reference(pixels, stride_px, kBlockPx, rows, scale);
  const __m256i w0 = _mm256_set1_epi32(out.w0);
  const __m256 steps = _mm256_set1_ps(scale.steps_times_raw);
  const __m256i us = _mm256_setr_epi16(0, 1, 2, 3, 0, 1, 2, 3, 4, 5, 6, 7, 4, 5, 6, 7);
  const __m256i ones = _mm256_set1_epi16(1);
  const __m256i twos = _mm256_set1_epi16(2);
  const __m256i limit = _mm256_set1_epi16(kMaxBlockStep);
  const __m256i zero = _mm256_setzero_si256();
  __m256i vs = _mm256_setr_epi16(0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0, 1, 1, 1, 1);
  __m256i sw = zero, suw = zero, svw = zero, sww = zero;
  for (int v = 0; v < rows; v += 2) {
    const __m128i first = load(pixels + v * stride_px);
    const __m128i second = v + 1 < rows ? load(pixels + (v + 1) * stride_px) : _mm_setzero_si128();
    const __m256 w_first = _mm256_div_ps(steps, _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(first)));
    const __m256 w_second = _mm256_div_ps(steps, _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(second)));
    __m256i d = _mm256_packs_epi32(_mm256_sub_epi32(_mm256_cvtps_epi32(w_first), w0),
                                   _mm256_sub_epi32(_mm256_cvtps_epi32(w_second), w0));
    const __m128i mask_first = valid_mask(first, min_raw);
    const __m128i mask_second = valid_mask(second, min_raw);
    const __m256i mask = _mm256_setr_m128i(_mm_unpacklo_epi64(mask_first, mask_second),
                                           _mm_unpackhi_epi64(mask_first, mask_second));
    d = _mm256_max_epi16(_mm256_min_epi16(d, limit), _mm256_sub_epi16(zero, limit));
    d = _mm256_and_si256(d, mask);
    sw = _mm256_add_epi32(sw, _mm256_madd_epi16(d, ones));
    suw = _mm256_add_epi32(suw, _mm256_madd_epi16(d, us));
    svw = _mm256_add_epi32(svw, _mm256_madd_epi16(d, vs));
    sww = _mm256_add_epi32(sww, _mm256_madd_epi16(d, d));
    vs = _mm256_add_epi16(vs, twos);
  }
  out.w = sum(halves(sw));
  out.uw = sum(halves(suw));
  out.vw = sum(halves(svw));
  out.ww = sum(halves(sww));
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
  for (int i = 0; i < blocks; ++i) {
    sum_block_avx2(pixels + i * kBlockPx, stride_px, rows, scale, out[i]);
  }
}

}  // namespace maplet::block
#endif
