// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/assign.hpp"

#include <cmath>
#include <cstring>

namespace maplet {

namespace {

// Eight lanes in the compiler's own vectors: pairs of registers where a register holds four.
using F8 = float __attribute__((vector_size(32)));
using I8 = std::int32_t __attribute__((vector_size(32)));
using U16x8 = std::uint16_t __attribute__((vector_size(16)));
using U8x8 = std::uint8_t __attribute__((vector_size(8)));

[[gnu::always_inline]] inline void assign_block(const std::uint16_t* pixels,
                                                std::ptrdiff_t stride_px, int rows,
                                                const DepthScale& scale, const LinearDepth* planes,
                                                int count, std::uint8_t* labels,
                                                std::ptrdiff_t labels_stride,
                                                std::uint32_t* won) noexcept {
  const F8 columns = {0.0F, 1.0F, 2.0F, 3.0F, 4.0F, 5.0F, 6.0F, 7.0F};
  const I8 min_raw = I8{} + scale.min_raw;
  const I8 max_raw = I8{} + scale.max_raw;
  I8 counts[kMaxAssigned] = {};
  for (int v = 0; v < rows; ++v) {
    U16x8 half;
    std::memcpy(&half, pixels + v * stride_px, sizeof half);
    const I8 raw = __builtin_convertvector(half, I8);
    const F8 w = scale.steps_times_raw / __builtin_convertvector(raw, F8);
    F8 best = F8{} + 1e9F;
    I8 winner = I8{} - 1;
    for (int c = 0; c < count; ++c) {
      const F8 residual = w - ((planes[c].corner + planes[c].per_v * static_cast<float>(v)) +
                               planes[c].per_u * columns);
      const F8 size = residual < 0.0F ? -residual : residual;
      const I8 closer = (size < best) & (size < planes[c].limit);
      best = closer ? size : best;
      winner = closer ? I8{} + c : winner;
    }
    winner |= (raw < min_raw) | (raw > max_raw);
    I8 name = I8{} + 255;
    for (int c = 0; c < count; ++c) {
      const I8 hit = winner == c;
      name = hit ? I8{} + planes[c].name : name;
      counts[c] -= hit;
    }
    const U8x8 out = __builtin_convertvector(name, U8x8);
    std::memcpy(labels + v * labels_stride, &out, sizeof out);
  }
  for (int c = 0; c < count; ++c) {
    for (int lane = 0; lane < 8; ++lane) won[c] += static_cast<std::uint32_t>(counts[c][lane]);
  }
}

#if defined(__x86_64__) || defined(__i386__)
__attribute__((target("avx2"))) void assign_block_avx2(
    const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows, const DepthScale& scale,
    const LinearDepth* planes, int count, std::uint8_t* labels, std::ptrdiff_t labels_stride,
    std::uint32_t* won) noexcept {
  assign_block(pixels, stride_px, rows, scale, planes, count, labels, labels_stride, won);
}
#endif

}  // namespace

void assign_block_plain(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows,
                        const DepthScale& scale, const LinearDepth* planes, int count,
                        std::uint8_t* labels, std::ptrdiff_t labels_stride,
                        std::uint32_t* won) noexcept {
  assign_block(pixels, stride_px, rows, scale, planes, count, labels, labels_stride, won);
}

AssignFunction best_assign_function() noexcept {
#if defined(__x86_64__) || defined(__i386__)
  if (__builtin_cpu_supports("avx2")) return assign_block_avx2;
#endif
  return assign_block_plain;
}

}  // namespace maplet
