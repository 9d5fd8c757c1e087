// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The block sums for ARM.
#if defined(__ARM_NEON)
#include "core/base/neon.hpp"
#include "core/patches/block.hpp"

namespace maplet::block {

namespace {

inline uint16x8_t valid_mask(uint16x8_t raw, uint16x8_t min_raw) noexcept {
  return vandq_u16(vcgeq_u16(raw, min_raw), vcltq_u16(raw, vdupq_n_u16(65535)));
}

inline std::uint64_t bits_of(uint16x8_t mask) noexcept {
  const uint16x8_t weights = {1, 2, 4, 8, 16, 32, 64, 128};
  return neon::sum(vandq_u16(mask, weights));
}

inline int32x4_t steps_of(uint16x4_t raw, float32x4_t steps) noexcept {
  return neon::rounded(neon::divided(steps, vcvtq_f32_u32(vmovl_u16(raw))));
}

/// The sums of a quarter while its rows are read.
struct Sums {
  int32x4_t w = vdupq_n_s32(0), uw = w, vw = w, ww = w;

  void add(int16x4_t d, int16x4_t us, int v) noexcept {
    w = vaddw_s16(w, d);
    uw = vmlal_s16(uw, d, us);
    vw = vmlal_n_s16(vw, d, static_cast<std::int16_t>(v));
    ww = vmlal_s16(ww, d, d);
  }
  [[nodiscard]] BlockSums::Quarter total() const noexcept {
    return {neon::sum(w), neon::sum(uw), neon::sum(vw), neon::sum(ww)};
  }
};

void sum_block(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
               const DepthScale& scale, BlockSums& out) noexcept {
  out = {};
  if (scale.max_raw < scale.min_raw) return;
  const uint16x8_t min_raw = vdupq_n_u16(scale.min_raw);
  for (int v = 0; v < rows; ++v) {
    out.valid |= bits_of(valid_mask(vld1q_u16(pixels + v * stride_px), min_raw)) << (8 * v);
  }
  if (out.valid == 0) return;
  out.w0 = reference(pixels, stride_px, kBlockPx, rows, scale);
  const int32x4_t w0 = vdupq_n_s32(out.w0);
  const float32x4_t steps = vdupq_n_f32(scale.steps_times_raw);
  const int16x4_t left_us = {0, 1, 2, 3};
  const int16x4_t right_us = {4, 5, 6, 7};
  const int16x8_t limit = vdupq_n_s16(kMaxBlockStep);
  Sums sums[4];
  for (int v = 0; v < rows; ++v) {
    const uint16x8_t raw = vld1q_u16(pixels + v * stride_px);
    const int32x4_t low = vqsubq_s32(steps_of(vget_low_u16(raw), steps), w0);
    const int32x4_t high = vqsubq_s32(steps_of(vget_high_u16(raw), steps), w0);
    int16x8_t d = vcombine_s16(vqmovn_s32(low), vqmovn_s32(high));
    d = vmaxq_s16(vminq_s16(d, limit), vnegq_s16(limit));
    d = vandq_s16(d, vreinterpretq_s16_u16(valid_mask(raw, min_raw)));
    sums[v / 4 * 2].add(vget_low_s16(d), left_us, v);
    sums[v / 4 * 2 + 1].add(vget_high_s16(d), right_us, v);
  }
  for (std::size_t k = 0; k < 4; ++k) out.quarters[k] = sums[k].total();
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
