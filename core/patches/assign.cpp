// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/assign.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "core/base/neon.hpp"

#if defined(__x86_64__) || defined(__i386__)
#include <immintrin.h>
#endif

namespace maplet {

namespace {

/// Counts a finished block's labels.
void count_plain(const std::uint8_t* labels, std::ptrdiff_t stride, int rows,
                 const LinearDepth* planes, int count, std::uint32_t* won) noexcept {
  for (int c = 0; c < count; ++c) {
    for (int v = 0; v < rows; ++v) {
      const std::uint8_t* row = labels + v * stride;
      won[c] += static_cast<std::uint32_t>(
          std::count(row, row + kBlockPx, static_cast<std::uint8_t>(planes[c].name)));
    }
  }
}

#if defined(__x86_64__) || defined(__i386__)
#define MAPLET_AVX2 __attribute__((target("avx2")))

/// Names of a row's pixels, 32 bits each.
MAPLET_AVX2 inline __m256i assign_row(__m128i raw, const DepthScale& scale, int v,
                                      const LinearDepth* planes, const __m256* slopes,
                                      int count) noexcept {
  const __m256i wide = _mm256_cvtepu16_epi32(raw);
  const __m256 w = _mm256_div_ps(_mm256_set1_ps(scale.steps_times_raw), _mm256_cvtepi32_ps(wide));
  const __m256 no_sign = _mm256_castsi256_ps(_mm256_set1_epi32(0x7FFFFFFF));
  __m256 best = _mm256_set1_ps(1.0F);
  __m256i name = _mm256_set1_epi32(kNobody);
  for (int c = 0; c < count; ++c) {
    const float left = planes[c].corner + planes[c].per_v * static_cast<float>(v);
    const __m256 off = _mm256_sub_ps(w, _mm256_add_ps(_mm256_set1_ps(left), slopes[c]));
    const __m256 size =
        _mm256_mul_ps(_mm256_and_ps(off, no_sign), _mm256_set1_ps(planes[c].per_limit));
    const __m256 closer = _mm256_cmp_ps(size, best, _CMP_LT_OQ);
    best = _mm256_min_ps(size, best);
    name = _mm256_blendv_epi8(name, _mm256_set1_epi32(planes[c].name), _mm256_castps_si256(closer));
  }
  const __m256i outside =
      _mm256_or_si256(_mm256_cmpgt_epi32(_mm256_set1_epi32(scale.min_raw), wide),
                      _mm256_cmpgt_epi32(wide, _mm256_set1_epi32(scale.max_raw)));
  return _mm256_or_si256(name, outside);  // all ones: still kNobody once it is a byte
}

MAPLET_AVX2 void assign_block_avx2(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                                   const DepthScale& scale, const LinearDepth* planes, int count,
                                   std::uint8_t* labels, std::ptrdiff_t labels_stride,
                                   std::uint32_t* won) noexcept {
  const __m256 columns = _mm256_setr_ps(0.0F, 1.0F, 2.0F, 3.0F, 4.0F, 5.0F, 6.0F, 7.0F);
  const __m256i byte = _mm256_set1_epi32(0xFF);
  const __m256i order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
  __m256 slopes[kMaxAssigned];
  for (int c = 0; c < count; ++c) {
    slopes[c] = _mm256_mul_ps(_mm256_set1_ps(planes[c].per_u), columns);
  }
  __m256i halves[2];
  for (int half = 0; half < 2; ++half) {
    __m256i row[4];
    for (int k = 0; k < 4; ++k) {
      const int v = 4 * half + k;
      const __m128i raw =
          v < rows ? _mm_loadu_si128(reinterpret_cast<const __m128i*>(pixels + v * stride_px))
                   : _mm_setzero_si128();
      row[k] = _mm256_and_si256(assign_row(raw, scale, v, planes, slopes, count), byte);
    }
    // Packing works within lanes; the permutation puts the rows together again.
    const __m256i packed = _mm256_packus_epi16(_mm256_packus_epi32(row[0], row[1]),
                                               _mm256_packus_epi32(row[2], row[3]));
    halves[half] = _mm256_permutevar8x32_epi32(packed, order);
    alignas(32) std::uint64_t bytes[4];
    _mm256_store_si256(reinterpret_cast<__m256i*>(bytes), halves[half]);
    for (int k = 0; k < 4 && 4 * half + k < rows; ++k) {
      std::memcpy(labels + (4 * half + k) * labels_stride, &bytes[k], sizeof bytes[k]);
    }
  }
  for (int c = 0; c < count; ++c) {
    const __m256i name = _mm256_set1_epi8(static_cast<char>(planes[c].name));
    const auto hits = [&](__m256i x) MAPLET_AVX2 {
      return std::popcount(
          static_cast<std::uint32_t>(_mm256_movemask_epi8(_mm256_cmpeq_epi8(x, name))));
    };
    won[c] += static_cast<std::uint32_t>(hits(halves[0]) + hits(halves[1]));
  }
}
#elif defined(__ARM_NEON)
/// Names of four pixels, 32 bits each.
inline uint32x4_t assign_four(uint16x4_t raw, const DepthScale& scale, int u, int v,
                              const LinearDepth* planes, int count) noexcept {
  const uint32x4_t wide = vmovl_u16(raw);
  const float32x4_t w = neon::divided(vdupq_n_f32(scale.steps_times_raw), vcvtq_f32_u32(wide));
  const float32x4_t zero_to_three = {0.0F, 1.0F, 2.0F, 3.0F};
  const float32x4_t columns = vaddq_f32(zero_to_three, vdupq_n_f32(static_cast<float>(u)));
  float32x4_t best = vdupq_n_f32(1.0F);
  uint32x4_t name = vdupq_n_u32(kNobody);
  for (int c = 0; c < count; ++c) {
    const float left = planes[c].corner + planes[c].per_v * static_cast<float>(v);
    const float32x4_t at = vaddq_f32(vdupq_n_f32(left), vmulq_n_f32(columns, planes[c].per_u));
    const float32x4_t size = vmulq_n_f32(vabsq_f32(vsubq_f32(w, at)), planes[c].per_limit);
    const uint32x4_t closer = vcltq_f32(size, best);
    best = vbslq_f32(closer, size, best);
    name = vbslq_u32(closer, vdupq_n_u32(static_cast<std::uint32_t>(planes[c].name)), name);
  }
  const uint32x4_t inside = vandq_u32(vcgeq_u32(wide, vdupq_n_u32(scale.min_raw)),
                                      vcleq_u32(wide, vdupq_n_u32(scale.max_raw)));
  return vbslq_u32(inside, name, vdupq_n_u32(kNobody));
}

void assign_block_neon(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                       const DepthScale& scale, const LinearDepth* planes, int count,
                       std::uint8_t* labels, std::ptrdiff_t labels_stride,
                       std::uint32_t* won) noexcept {
  for (int v = 0; v < rows; ++v) {
    const uint16x8_t raw = vld1q_u16(pixels + v * stride_px);
    const uint16x4_t left = vmovn_u32(assign_four(vget_low_u16(raw), scale, 0, v, planes, count));
    const uint16x4_t right = vmovn_u32(assign_four(vget_high_u16(raw), scale, 4, v, planes, count));
    const uint8x8_t names = vmovn_u16(vcombine_u16(left, right));
    vst1_u8(labels + v * labels_stride, names);
    for (int c = 0; c < count; ++c) {
      const uint8x8_t hit = vceq_u8(names, vdup_n_u8(static_cast<std::uint8_t>(planes[c].name)));
      won[c] += neon::sum(vshr_n_u8(hit, 7));
    }
  }
}
#endif

}  // namespace

void assign_block_plain(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                        const DepthScale& scale, const LinearDepth* planes, int count,
                        std::uint8_t* labels, std::ptrdiff_t labels_stride,
                        std::uint32_t* won) noexcept {
  for (int v = 0; v < rows; ++v) {
    for (int u = 0; u < kBlockPx; ++u) {
      const std::uint16_t raw = pixels[v * stride_px + u];
      const float w = scale.steps_times_raw / static_cast<float>(raw);
      float best = 1.0F;
      std::int32_t name = kNobody;
      for (int c = 0; c < count; ++c) {
        const LinearDepth& p = planes[c];
        const float left = p.corner + p.per_v * static_cast<float>(v);
        const float size = std::abs(w - (left + p.per_u * static_cast<float>(u))) * p.per_limit;
        if (size >= best || size != size) continue;
        best = size;
        name = p.name;
      }
      labels[v * labels_stride + u] = static_cast<std::uint8_t>(scale.valid(raw) ? name : kNobody);
    }
  }
  count_plain(labels, labels_stride, rows, planes, count, won);
}

AssignFunction best_assign_function() noexcept {
#if defined(__x86_64__) || defined(__i386__)
  if (__builtin_cpu_supports("avx2")) return assign_block_avx2;
#elif defined(__ARM_NEON)
  return assign_block_neon;
#endif
  return assign_block_plain;
}

}  // namespace maplet
