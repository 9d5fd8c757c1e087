// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/block.hpp"

#include <algorithm>
#include <cmath>

#include "core/patches/block_count.hpp"

namespace maplet {

DepthScale DepthScale::of(double metres_per_unit) noexcept {
  DepthScale scale;
  const double steps = kInverseDepthSteps / metres_per_unit;
  if (!(steps > 0.0 && steps < 1e12)) {
    scale.min_raw = 1;
    scale.max_raw = 0;
    return scale;
  }
  scale.min_raw =
      static_cast<std::uint16_t>(std::clamp(std::ceil(kNearestM / metres_per_unit), 1.0, 65535.0));
  scale.steps_times_raw = static_cast<float>(steps);
  return scale;
}

Moments BlockSums::moments(int u0, int v0, int row_step) const noexcept {
  const double step = row_step;
  const double du = u0, dv = v0, dw = w0;
  const double count = n, su = u, sv = v * step, sw = w;
  Moments m;
  m.n = count;
  m.u = su + count * du;
  m.v = sv + count * dv;
  m.w = sw + count * dw;
  m.uu = uu + 2.0 * du * su + count * du * du;
  m.uv = uv * step + du * sv + dv * su + count * du * dv;
  m.vv = vv * step * step + 2.0 * dv * sv + count * dv * dv;
  m.uw = uw + du * sw + dw * su + count * du * dw;
  m.vw = vw * step + dv * sw + dw * sv + count * dv * dw;
  m.ww = ww + 2.0 * dw * sw + count * dw * dw;
  return m;
}

namespace {

/// Rounds half to even, as the vector units do.
std::int32_t steps_of(std::uint16_t raw, const DepthScale& scale) noexcept {
  return static_cast<std::int32_t>(
      std::nearbyintf(scale.steps_times_raw / static_cast<float>(raw)));
}

}  // namespace

std::int32_t block::reference(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int columns,
                              int rows, const DepthScale& scale) noexcept {
  const std::uint16_t middle = pixels[rows / 2 * stride_px + std::min(columns - 1, kBlockPx / 2)];
  if (scale.valid(middle)) return steps_of(middle, scale);
  std::uint16_t nearest = 65535;
  for (int v = 0; v < rows; ++v) {
    for (int u = 0; u < columns; ++u) {
      const std::uint16_t raw = pixels[v * stride_px + u];
      if (scale.valid(raw)) nearest = std::min(nearest, raw);
    }
  }
  return nearest == 65535 ? 0 : steps_of(nearest, scale);
}

void sum_block_plain(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int columns, int rows,
                     const DepthScale& scale, BlockSums& out) noexcept {
  out = {};
  out.w0 = block::reference(pixels, stride_px, columns, rows, scale);
  for (int v = 0; v < rows; ++v) {
    for (int u = 0; u < columns; ++u) {
      const std::uint16_t raw = pixels[v * stride_px + u];
      if (!scale.valid(raw)) continue;
      const std::int32_t d =
          std::clamp(steps_of(raw, scale) - out.w0, -kMaxBlockStep, kMaxBlockStep);
      out.n += 1;
      out.u += u, out.v += v;
      out.uu += u * u, out.uv += u * v, out.vv += v * v;
      out.w += d, out.uw += u * d, out.vw += v * d, out.ww += d * d;
    }
  }
}

void sum_blocks_plain(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int rows, int blocks,
                      const DepthScale& scale, BlockSums* out) noexcept {
  for (int i = 0; i < blocks; ++i) {
    sum_block_plain(pixels + i * kBlockPx, stride_px, kBlockPx, rows, scale, out[i]);
  }
}

std::vector<BlockVariant> block_variants() {
  std::vector<BlockVariant> out{{"plain", sum_blocks_plain}};
#if defined(__x86_64__) || defined(__i386__)
  if (__builtin_cpu_supports("sse2")) out.push_back({"sse2", block::sum_blocks_sse2});
  if (__builtin_cpu_supports("avx2")) out.push_back({"avx2", block::sum_blocks_avx2});
#elif defined(__aarch64__)
  out.push_back({"neon", block::sum_blocks_neon});
#endif
  return out;
}

}  // namespace maplet
