// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/block.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

DepthScale DepthScale::of(double metres_per_unit) noexcept {
  DepthScale scale;
  const double steps = kInverseDepthSteps / metres_per_unit;
  if (!(metres_per_unit > 0.0) || !(steps < 1e12)) {
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

void sum_block_plain(const std::uint16_t* pixels, std::ptrdiff_t stride_px, int columns, int rows,
                     const DepthScale& scale, BlockSums& out) noexcept {
  out = {};
  std::int32_t w[kBlockPx][kBlockPx] = {};
  std::int32_t nearest = 0;
  for (int v = 0; v < rows; ++v) {
    for (int u = 0; u < columns; ++u) {
      const std::uint16_t raw = pixels[v * stride_px + u];
      // Rounds half to even, as the vector units do.
      w[v][u] = scale.valid(raw) ? static_cast<std::int32_t>(std::nearbyintf(
                                       scale.steps_times_raw / static_cast<float>(raw)))
                                 : -1;
      nearest = std::max(nearest, w[v][u]);
    }
  }
  const std::int32_t middle = w[rows / 2][std::min(columns - 1, kBlockPx / 2)];
  out.w0 = middle >= 0 ? middle : nearest;
  for (int v = 0; v < rows; ++v) {
    for (int u = 0; u < columns; ++u) {
      if (w[v][u] < 0) continue;
      const std::int32_t d = std::clamp(w[v][u] - out.w0, -kMaxBlockStep, kMaxBlockStep);
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

BlockRowFunction best_block_function() noexcept { return sum_blocks_plain; }

}  // namespace maplet
