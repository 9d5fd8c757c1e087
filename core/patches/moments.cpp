// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/moments.hpp"

#include <algorithm>

namespace maplet {

namespace {

/// Determinant over product of variances below which pixels lie on one line.
constexpr double kLineRatio = 1e-6;

}  // namespace

Fit fit(const Moments& m) noexcept {
  Fit f;
  if (m.n <= 0.0) return f;
  const double inv_n = 1.0 / m.n;
  f.u0 = m.u * inv_n;
  f.v0 = m.v * inv_n;
  f.w0 = m.w * inv_n;
  const double uu = m.uu - m.u * f.u0;
  const double uv = m.uv - m.u * f.v0;
  const double vv = m.vv - m.v * f.v0;
  const double uw = m.uw - m.u * f.w0;
  const double vw = m.vw - m.v * f.w0;
  const double ww = m.ww - m.w * f.w0;
  const double det = uu * vv - uv * uv;
  if (!(det > kLineRatio * uu * vv)) {
    f.rss = std::max(0.0, ww);
    return f;
  }
  const double inv_det = 1.0 / det;
  f.a = (vv * uw - uv * vw) * inv_det;
  f.b = (uu * vw - uv * uw) * inv_det;
  f.rss = std::max(0.0, ww - f.a * uw - f.b * vw);
  f.ok = true;
  return f;
}

Eigen::Vector3d PixelFrame::theta(const Fit& f) const noexcept {
  const double scale = 1.0 / kInverseDepthSteps;
  const double w_axis = f.at(cx, cy);
  return {f.a / inv_fx * scale, f.b / inv_fy * scale, w_axis * scale};
}

Eigen::Matrix3d PixelFrame::normal_matrix(const Moments& m) const noexcept {
  const double inv_n = 1.0 / m.n;
  const double u0 = m.u * inv_n;
  const double v0 = m.v * inv_n;
  const double x = (u0 - cx) * inv_fx;
  const double y = (v0 - cy) * inv_fy;
  const double xx = (m.uu - m.u * u0) * inv_fx * inv_fx + m.n * x * x;
  const double xy = (m.uv - m.u * v0) * inv_fx * inv_fy + m.n * x * y;
  const double yy = (m.vv - m.v * v0) * inv_fy * inv_fy + m.n * y * y;
  Eigen::Matrix3d out;
  out << xx, xy, m.n * x, xy, yy, m.n * y, m.n * x, m.n * y, m.n;
  return out;
}

}  // namespace maplet
