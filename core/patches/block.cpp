// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/block.hpp"

#include <algorithm>
#include <cmath>

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

namespace {

struct WSums {
  double w, uw, vw, ww;
};

/// Sums over pixels counted from a corner become moments counted from elsewhere.
[[gnu::always_inline]] inline Moments shifted(const PixelCount& c, const WSums& s, std::int32_t w0,
                                              int u0, int v0, int row_step) noexcept {
  const double step = row_step;
  const double du = u0, dv = v0, dw = w0;
  const double n = c.n, u = c.u, v = c.v * step, vw = s.vw * step;
  const double n_du = n * du, n_dv = n * dv, n_dw = n * dw;
  Moments m;
  m.n = n;
  m.u = u + n_du;
  m.v = v + n_dv;
  m.w = s.w + n_dw;
  m.uu = c.uu + du * (2.0 * u + n_du);
  m.uv = c.uv * step + du * v + dv * (u + n_du);
  m.vv = c.vv * step * step + dv * (2.0 * v + n_dv);
  m.uw = s.uw + du * s.w + dw * (u + n_du);
  m.vw = vw + dv * s.w + dw * (v + n_dv);
  m.ww = s.ww + dw * (2.0 * s.w + n_dw);
  return m;
}

WSums all_quarters(const BlockSums& b) noexcept {
  std::int64_t ww = 0;
  std::int32_t w = 0, uw = 0, vw = 0;
  for (const BlockSums::Quarter& q : b.quarters) w += q.w, uw += q.uw, vw += q.vw, ww += q.ww;
  return {static_cast<double>(w), static_cast<double>(uw), static_cast<double>(vw),
          static_cast<double>(ww)};
}

/// Of a row of 8 pixels by its bits: how many, and sums of u and u^2, 16 bits each from the lowest;
/// no sum over a block leaves its 16 bits.
constexpr std::array<std::uint64_t, 256> kRowCounts = [] {
  std::array<std::uint64_t, 256> out{};
  for (unsigned bits = 0; bits < 256; ++bits) {
    for (std::uint64_t u = 0; u < 8; ++u) {
      if ((bits >> u & 1U) != 0) out[bits] += 1 | u << 16 | u * u << 32;
    }
  }
  return out;
}();

constexpr PixelCount kFull{64, 224, 224, 1120, 784, 1120};
constexpr std::array<PixelCount, 4> kFullQuarters{{{16, 24, 24, 56, 36, 56},
                                                   {16, 88, 24, 504, 132, 56},
                                                   {16, 24, 88, 56, 132, 504},
                                                   {16, 88, 88, 504, 484, 504}}};

}  // namespace

PixelCount PixelCount::of(std::uint64_t valid) noexcept {
  if (valid == BlockSums::kAll) return kFull;
  // Sums of sums from below count a row v times, and v (v + 1) / 2 times.
  std::uint64_t plain = 0, by_v = 0, by_half = 0;
  for (unsigned v = 7; v > 0; --v) {
    plain += kRowCounts[valid >> (8 * v) & 0xFF];
    by_v += plain;
    by_half += by_v;
  }
  plain += kRowCounts[valid & 0xFF];
  const auto field = [](std::uint64_t sums, int k) {
    return static_cast<std::int32_t>(sums >> (16 * k) & 0xFFFF);
  };
  return {field(plain, 0), field(plain, 1), field(by_v, 0),
          field(plain, 2), field(by_v, 1),  2 * field(by_half, 0) - field(by_v, 0)};
}

Moments BlockSums::moments(int u0, int v0, int row_step) const noexcept {
  if (valid == kAll && row_step == 1) return shifted(kFull, all_quarters(*this), w0, u0, v0, 1);
  return shifted(PixelCount::of(valid), all_quarters(*this), w0, u0, v0, row_step);
}

Moments BlockSums::quarter_moments(int quarter, int u0, int v0, int row_step) const noexcept {
  const Quarter& q = quarters[static_cast<std::size_t>(quarter)];
  const WSums sums{static_cast<double>(q.w), static_cast<double>(q.uw), static_cast<double>(q.vw),
                   static_cast<double>(q.ww)};
  const std::uint64_t own = valid & mask(quarter);
  const bool full = own == mask(quarter);
  return shifted(full ? kFullQuarters[static_cast<std::size_t>(quarter)] : PixelCount::of(own),
                 sums, w0, u0, v0, row_step);
}

Fit BlockSums::full_fit(int u0, int v0) const noexcept {
  constexpr double kVariance = 64.0 * 5.25;  // sum of (u - 3.5)^2
  const WSums s = all_quarters(*this);
  const double uw = s.uw - 3.5 * s.w;
  const double vw = s.vw - 3.5 * s.w;
  return {.u0 = u0 + 3.5,
          .v0 = v0 + 3.5,
          .w0 = w0 + s.w / 64.0,
          .a = uw / kVariance,
          .b = vw / kVariance,
          .rss = std::max(0.0, s.ww - s.w * s.w / 64.0 - (uw * uw + vw * vw) / kVariance),
          .ok = true};
}

Fit BlockSums::full_quarter_fit(int quarter, int u0, int v0) const noexcept {
  constexpr double kVariance = 16.0 * 1.25;  // sum of (u - 1.5)^2
  const Quarter& q = quarters[static_cast<std::size_t>(quarter)];
  const double u = quarter % 2 == 0 ? 1.5 : 5.5;
  const double v = quarter / 2 == 0 ? 1.5 : 5.5;
  const double w = q.w;
  const double uw = q.uw - u * w;
  const double vw = q.vw - v * w;
  return {.u0 = u0 + u,
          .v0 = v0 + v,
          .w0 = w0 + w / 16.0,
          .a = uw / kVariance,
          .b = vw / kVariance,
          .rss = std::max(0.0, q.ww - w * w / 16.0 - (uw * uw + vw * vw) / kVariance),
          .ok = true};
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
      out.valid |= std::uint64_t{1} << (8 * v + u);
      BlockSums::Quarter& q = out.quarters[static_cast<std::size_t>(v / 4 * 2 + u / 4)];
      q.w += d, q.uw += u * d, q.vw += v * d, q.ww += d * d;
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
#elif defined(__ARM_NEON)
  out.push_back({"neon", block::sum_blocks_neon});
#endif
  return out;
}

}  // namespace maplet
