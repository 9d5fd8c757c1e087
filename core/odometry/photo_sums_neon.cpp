// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The photometric sums for ARM: four points at a time.
#if defined(__ARM_NEON)
#include <algorithm>
#include <array>
#include <limits>

#include "core/base/neon.hpp"
#include "core/odometry/photo_sums.hpp"

namespace maplet {

namespace {

using Points = PhotoVariant::Points;
using Three = std::array<float32x4_t, 3>;
static_assert(sizeof(PhotoPoint) == 4 * sizeof(float));

#define MAPLET_INLINE [[gnu::always_inline]] inline

// Lanes of unseen points are zero everywhere but in `seen`.
struct Four {
  uint32x4_t seen;
  float32x4_t before, now;  // intensities
  Three slope, p;
};

MAPLET_INLINE float32x4_t only(uint32x4_t lanes, float32x4_t x) noexcept {
  return vreinterpretq_f32_u32(vandq_u32(lanes, vreinterpretq_u32_f32(x)));
}

// R p + t in the plain variant's order.
MAPLET_INLINE Three moved(const Eigen::Matrix3f& R, const Eigen::Vector3f& t,
                          const Three& p) noexcept {
  Three out;
  for (int i = 0; i < 3; ++i) {
    float32x4_t sum = vaddq_f32(vmulq_n_f32(p[0], R(i, 0)), vmulq_n_f32(p[1], R(i, 1)));
    sum = vaddq_f32(sum, vmulq_n_f32(p[2], R(i, 2)));
    out[static_cast<std::size_t>(i)] = vaddq_f32(sum, vdupq_n_f32(t[i]));
  }
  return out;
}

// The four pixels around each place.
struct Corners {
  std::array<float32x4_t, 4> value;
};

MAPLET_INLINE Corners corners(const PhotoLook& look, int32x4_t column, int32x4_t row) noexcept {
  std::int32_t at[4];
  vst1q_s32(at, vmlaq_n_s32(column, row, look.width));
  std::uint32_t pixels[4][4];
  for (int k = 0; k < 4; ++k) {
    const std::uint8_t* q = look.pixels + at[k];
    pixels[0][k] = q[0], pixels[1][k] = q[1];
    pixels[2][k] = q[look.width], pixels[3][k] = q[look.width + 1];
  }
  Corners out;
  for (std::size_t i = 0; i < 4; ++i) out.value[i] = vcvtq_f32_u32(vld1q_u32(pixels[i]));
  return out;
}

MAPLET_INLINE Four look_at(const PhotoLook& look, const PhotoPoint* points) noexcept {
  Four out;
  const float32x4x4_t point = vld4q_f32(points->p.data());
  const Three p = moved(look.R, look.t, {point.val[0], point.val[1], point.val[2]});
  const Three g = moved(look.R_gray, look.t_gray, p);
  const float32x4_t inverse = neon::divided(vdupq_n_f32(1.0F), g[2]);
  const float32x4_t x = vmulq_f32(g[0], inverse);
  const float32x4_t y = vmulq_f32(g[1], inverse);
  const float32x4_t u = vaddq_f32(vmulq_n_f32(x, look.fx), vdupq_n_f32(look.cx));
  const float32x4_t v = vaddq_f32(vmulq_n_f32(y, look.fy), vdupq_n_f32(look.cy));
  const float32x4_t zero = vdupq_n_f32(0.0F);
  out.seen =
      vandq_u32(vcgtq_f32(g[2], vdupq_n_f32(PhotoLook::kNearestM)),
                vandq_u32(vandq_u32(vcgeq_f32(u, zero), vcltq_f32(u, vdupq_n_f32(look.u_end))),
                          vandq_u32(vcgeq_f32(v, zero), vcltq_f32(v, vdupq_n_f32(look.v_end)))));
  const int32x4_t lanes = vreinterpretq_s32_u32(out.seen);
  const int32x4_t column = vandq_s32(lanes, vcvtq_s32_f32(u));  // the first pixel for unseen ones
  const int32x4_t row = vandq_s32(lanes, vcvtq_s32_f32(v));
  const float32x4_t a = vsubq_f32(u, vcvtq_f32_s32(column));
  const float32x4_t b = vsubq_f32(v, vcvtq_f32_s32(row));
  const auto [i00, i10, i01, i11] = corners(look, column, row).value;
  const float32x4_t across_top = vsubq_f32(i10, i00);
  const float32x4_t across_low = vsubq_f32(i11, i01);
  const float32x4_t top = vaddq_f32(i00, vmulq_f32(a, across_top));
  const float32x4_t down = vsubq_f32(vaddq_f32(i01, vmulq_f32(a, across_low)), top);
  out.before = only(out.seen, point.val[3]);
  out.now = only(out.seen, vaddq_f32(top, vmulq_f32(b, down)));
  const float32x4_t twist = vmulq_f32(b, vsubq_f32(across_low, across_top));
  const float32x4_t gu = vmulq_n_f32(vaddq_f32(across_top, twist), look.fx);
  const float32x4_t gv = vmulq_n_f32(down, look.fy);
  const Three by_gray = {
      vmulq_f32(gu, inverse), vmulq_f32(gv, inverse),
      vmulq_f32(vnegq_f32(vaddq_f32(vmulq_f32(gu, x), vmulq_f32(gv, y))), inverse)};
  const Three slope = moved(look.R_gray.transpose(), Eigen::Vector3f::Zero(), by_gray);
  for (std::size_t i = 0; i < 3; ++i) {
    out.slope[i] = only(out.seen, slope[i]);
    out.p[i] = only(out.seen, p[i]);
  }
  return out;
}

template <class Take>
MAPLET_INLINE void in_fours(const PhotoLook& look, Points points, Take&& take) noexcept {
  std::size_t i = 0;
  for (; i + 4 <= points.size(); i += 4) take(look_at(look, &points[i]));
  if (i == points.size()) return;
  std::array<PhotoPoint, 4> last;
  last.fill({Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN()), 0.0F});
  std::copy(points.begin() + static_cast<std::ptrdiff_t>(i), points.end(), last.begin());
  take(look_at(look, last.data()));
}

struct Weighted {
  float32x4_t residual, weight;
};

MAPLET_INLINE Weighted weighted(const Four& four, const Brightness& by) noexcept {
  float32x4_t r = vsubq_f32(four.now, vmulq_n_f32(four.before, by.gain));
  r = only(four.seen, vsubq_f32(r, vdupq_n_f32(by.offset)));
  const float32x4_t x = vmulq_n_f32(r, 1.0F / by.sigma);
  const float32x4_t of = vaddq_f32(vdupq_n_f32(kPhotoTailDof), vmulq_f32(x, x));
  const float32x4_t weight = vmulq_n_f32(neon::reciprocal(of), kPhotoTailDof + 1.0F);
  return {r, only(four.seen, weight)};
}

IntensitySums intensities(const PhotoLook& look, Points points, const Brightness& by) noexcept {
  float32x4_t n = vdupq_n_f32(0.0F), x = n, y = n, xx = n, xy = n;
  in_fours(look, points, [&](const Four& four) {
    const float32x4_t w = weighted(four, by).weight;
    const float32x4_t wx = vmulq_f32(w, four.before);
    n = vaddq_f32(n, w);
    x = vaddq_f32(x, wx);
    y = vmlaq_f32(y, w, four.now);
    xx = vmlaq_f32(xx, wx, four.before);
    xy = vmlaq_f32(xy, wx, four.now);
  });
  return {neon::sum(n), neon::sum(x), neon::sum(y), neon::sum(xx), neon::sum(xy)};
}

SpreadSums spread(const PhotoLook& look, Points points, const Brightness& by) noexcept {
  float32x4_t squared = vdupq_n_f32(0.0F);
  uint32x4_t count = vdupq_n_u32(0);
  in_fours(look, points, [&](const Four& four) {
    const auto [r, w] = weighted(four, by);
    squared = vmlaq_f32(squared, vmulq_f32(w, r), r);
    count = vsubq_u32(count, four.seen);
  });
  return {neon::sum(squared), static_cast<float>(neon::sum(vreinterpretq_s32_u32(count)))};
}

PhotoEquations equations(const PhotoLook& look, Points points, const Brightness& by) noexcept {
  std::array<float32x4_t, 21> H;  // the lower triangle, column by column
  std::array<float32x4_t, 6> b;
  H.fill(vdupq_n_f32(0.0F));
  b.fill(vdupq_n_f32(0.0F));
  uint32x4_t seen = vdupq_n_u32(0), kept = seen;
  const float32x4_t limit = vdupq_n_f32(kPhotoKeptSigmas * by.sigma);
  in_fours(look, points, [&](const Four& four) {
    const auto [r, w] = weighted(four, by);
    const Three& s = four.slope;
    const Three& p = four.p;
    const std::array<float32x4_t, 6> J = {s[0],
                                          s[1],
                                          s[2],
                                          vmlsq_f32(vmulq_f32(p[1], s[2]), p[2], s[1]),
                                          vmlsq_f32(vmulq_f32(p[2], s[0]), p[0], s[2]),
                                          vmlsq_f32(vmulq_f32(p[0], s[1]), p[1], s[0])};
    std::size_t k = 0;
    for (std::size_t j = 0; j < 6; ++j) {
      const float32x4_t wj = vmulq_f32(w, J[j]);
      b[j] = vmlaq_f32(b[j], wj, r);
      for (std::size_t i = j; i < 6; ++i, ++k) H[k] = vmlaq_f32(H[k], wj, J[i]);
    }
    seen = vsubq_u32(seen, four.seen);
    kept = vsubq_u32(kept, vandq_u32(four.seen, vcltq_f32(vabsq_f32(r), limit)));
  });
  PhotoEquations out;
  std::size_t k = 0;
  for (int j = 0; j < 6; ++j) {
    out.b[j] = neon::sum(b[static_cast<std::size_t>(j)]);
    for (int i = j; i < 6; ++i, ++k) out.H(i, j) = neon::sum(H[k]);
  }
  out.seen = neon::sum(vreinterpretq_s32_u32(seen));
  out.kept = neon::sum(vreinterpretq_s32_u32(kept));
  return out;
}

}  // namespace

const PhotoVariant kPhotoNeon{"neon", intensities, spread, equations};

}  // namespace maplet
#endif
