// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The block sums for 64-bit ARM. 32-bit NEON has no exact division: it takes the plain variant.
#if defined(__aarch64__)
#include <arm_neon.h>

#include "core/patches/block.hpp"
#include "core/patches/block_count.hpp"

namespace maplet::block {

namespace {

inline uint16x8_t valid_mask(uint16x8_t raw, uint16x8_t min_raw) noexcept {
  return vandq_u16(vcgeq_u16(raw, min_raw), vcltq_u16(raw, vdupq_n_u16(65535)));
}

inline unsigned bits_of(uint16x8_t mask) noexcept {
  const uint16x8_t weights = {1, 2, 4, 8, 16, 32, 64, 128};
  return vaddvq_u16(vandq_u16(mask, weights));
}

inline int32x4_t steps_of(uint16x4_t raw, float32x4_t steps) noexcept {
  return vcvtnq_s32_f32(vdivq_f32(steps, vcvtq_f32_u32(vmovl_u16(raw))));
}

void sum_block(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
               const DepthScale& scale, BlockSums& out) noexcept {
  out = {};
  if (scale.max_raw < scale.min_raw) return;
  const uint16x8_t min_raw = vdupq_n_u16(scale.min_raw);
  for (int v = 0; v < rows; ++v) {
    count_row(bits_of(valid_mask(vld1q_u16(pixels + v * stride_px), min_raw)), v, out);
  }
  if (out.n == 0) return;
  out.w0 = reference(pixels, stride_px, kBlockPx, rows, scale);
  const int32x4_t w0 = vdupq_n_s32(out.w0);
  const float32x4_t steps = vdupq_n_f32(scale.steps_times_raw);
  const int16x8_t us = {0, 1, 2, 3, 4, 5, 6, 7};
  const int16x8_t limit = vdupq_n_s16(kMaxBlockStep);
  int32x4_t sw = vdupq_n_s32(0), suw = sw, svw = sw, sww = sw;
  for (int v = 0; v < rows; ++v) {
    const uint16x8_t raw = vld1q_u16(pixels + v * stride_px);
    const int32x4_t low = vqsubq_s32(steps_of(vget_low_u16(raw), steps), w0);
    const int32x4_t high = vqsubq_s32(steps_of(vget_high_u16(raw), steps), w0);
    int16x8_t d = vcombine_s16(vqmovn_s32(low), vqmovn_s32(high));
    d = vmaxq_s16(vminq_s16(d, limit), vnegq_s16(limit));
    d = vandq_s16(d, vreinterpretq_s16_u16(valid_mask(raw, min_raw)));
    const int16x4_t a = vget_low_s16(d);
    const int16x4_t b = vget_high_s16(d);
    sw = vpadalq_s16(sw, d);
    suw = vmlal_s16(vmlal_s16(suw, a, vget_low_s16(us)), b, vget_high_s16(us));
    svw = vmlal_n_s16(vmlal_n_s16(svw, a, static_cast<std::int16_t>(v)), b,
                      static_cast<std::int16_t>(v));
    sww = vmlal_s16(vmlal_s16(sww, a, a), b, b);
  }
  out.w = vaddvq_s32(sw);
  out.uw = vaddvq_s32(suw);
  out.vw = vaddvq_s32(svw);
  out.ww = vaddvq_s32(sww);
}

}  // namespace

void sum_blocks_neon(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows, int blocks,
                     const DepthScale& scale, BlockSums* out) noexcept {
  for (int i = 0; i < blocks; ++i) {
    sum_block(pixels + i * kBlockPx, stride_px, rows, scale, out[i]);
  }
}

}  // namespace maplet::block
#endif
