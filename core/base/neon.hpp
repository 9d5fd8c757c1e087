// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#if defined(__ARM_NEON)
#include <arm_neon.h>

#include <cstdint>

/// What 64-bit NEON has and 32-bit NEON has not, for both; the same results bit by bit.
namespace maplet::neon {

/// Correctly rounded: on 32-bit ARM a division a lane, on the scalar unit.
inline float32x4_t divided(float32x4_t a, float32x4_t b) noexcept { return a / b; }

/// 1 / x to about the last bit, for what need not be the same everywhere.
inline float32x4_t reciprocal(float32x4_t x) noexcept {
  float32x4_t y = vrecpeq_f32(x);
  y = vmulq_f32(y, vrecpsq_f32(x, y));
  return vmulq_f32(y, vrecpsq_f32(x, y));
}

/// Rounds half to even.
/// @param x  below 2^22; what is larger, or no number, becomes any integer
inline int32x4_t rounded(float32x4_t x) noexcept {
#if defined(__aarch64__)
  return vcvtnq_s32_f32(x);
#else
  const float32x4_t shift = vdupq_n_f32(12582912.0F);  // 1.5 * 2^23: its last bit is worth one
  return vcvtq_s32_f32(vsubq_f32(vaddq_f32(x, shift), shift));
#endif
}

inline std::int32_t sum(int32x4_t x) noexcept {
#if defined(__aarch64__)
  return vaddvq_s32(x);
#else
  const int32x2_t halves = vadd_s32(vget_low_s32(x), vget_high_s32(x));
  return vget_lane_s32(vpadd_s32(halves, halves), 0);
#endif
}

inline float sum(float32x4_t x) noexcept {
#if defined(__aarch64__)
  return vaddvq_f32(x);
#else
  const float32x2_t halves = vadd_f32(vget_low_f32(x), vget_high_f32(x));
  return vget_lane_f32(vpadd_f32(halves, halves), 0);
#endif
}

inline std::uint16_t sum(uint16x8_t x) noexcept {
#if defined(__aarch64__)
  return vaddvq_u16(x);
#else
  const uint64x2_t halves = vpaddlq_u32(vpaddlq_u16(x));
  return static_cast<std::uint16_t>(vgetq_lane_u64(halves, 0) + vgetq_lane_u64(halves, 1));
#endif
}

inline std::uint8_t sum(uint8x8_t x) noexcept {
#if defined(__aarch64__)
  return vaddv_u8(x);
#else
  return static_cast<std::uint8_t>(vget_lane_u64(vpaddl_u32(vpaddl_u16(vpaddl_u8(x))), 0));
#endif
}

}  // namespace maplet::neon
#endif
