// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/geometry/camera_model.hpp"

namespace maplet {

/// Inverse depth is counted in whole steps of 2^-15 1/m: far below the noise of any sensor
/// (Kinect: 47 steps), so sums are sums of integers and do not depend on their order.
inline constexpr double kInverseDepthSteps = 32768.0;  ///< per 1/m

/// Sums over pixels of 1, u, v, w and their products; u, v count from the image's middle pixel and
/// w = 1/Z in steps. Doubles that hold integers: adding is exact up to 2^53, about 250 000 pixels
/// at half a metre.
///
/// Math  docs/math/patches.md, eq. 2
struct Moments {
  double n = 0.0;
  double u = 0.0, v = 0.0, w = 0.0;
  double uu = 0.0, uv = 0.0, vv = 0.0;
  double uw = 0.0, vw = 0.0, ww = 0.0;

  Moments& operator+=(const Moments& o) noexcept {
    n += o.n;
    u += o.u, v += o.v, w += o.w;
    uu += o.uu, uv += o.uv, vv += o.vv;
    uw += o.uw, vw += o.vw, ww += o.ww;
    return *this;
  }
  Moments& operator*=(double weight) noexcept {
    n *= weight;
    u *= weight, v *= weight, w *= weight;
    uu *= weight, uv *= weight, vv *= weight;
    uw *= weight, vw *= weight, ww *= weight;
    return *this;
  }
  [[nodiscard]] friend Moments operator+(Moments a, const Moments& b) noexcept { return a += b; }
};

/// The least-squares plane w = w0 + a (u - u0) + b (v - v0) of some pixels.
struct Fit {
  double u0 = 0.0, v0 = 0.0, w0 = 0.0;  ///< means
  double a = 0.0, b = 0.0;              ///< steps per pixel
  double rss = 0.0;                     ///< sum of squared residuals, steps^2
  bool ok = false;                      ///< false: fewer than three pixels, or all on one line

  [[nodiscard]] double at(double u, double v) const noexcept {
    return w0 + a * (u - u0) + b * (v - v0);
  }
};

/// Math  docs/math/patches.md, eq. 3-4. O(1).
[[nodiscard]] Fit fit(const Moments& m) noexcept;

/// Pixels counted from the middle one <-> the camera's rays.
struct PixelFrame {
  explicit PixelFrame(const CameraModel& camera) noexcept
      : inv_fx{1.0 / camera.fx_px},
        inv_fy{1.0 / camera.fy_px},
        cx{camera.cx_px - camera.width_px / 2},
        cy{camera.cy_px - camera.height_px / 2} {}

  double inv_fx, inv_fy;
  double cx, cy;  ///< principal point

  [[nodiscard]] Eigen::Vector2d ray(double u, double v) const noexcept {
    return {(u - cx) * inv_fx, (v - cy) * inv_fy};
  }
  /// 1/m. Math: docs/math/patches.md, eq. 5.
  [[nodiscard]] Eigen::Vector3d theta(const Fit& f) const noexcept;
  /// M^T M of the pixels: times 1/sigma^2 the information of theta. Math: eq. 6.
  [[nodiscard]] Eigen::Matrix3d normal_matrix(const Moments& m) const noexcept;
};

}  // namespace maplet
