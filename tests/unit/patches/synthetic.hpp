// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "core/frame/depth_frame.hpp"

namespace maplet::test {

/// A depth image that owns its pixels, and the means to draw planes into it.
struct Image {
  int width, height;
  double metres_per_unit = 0.001;
  CameraModel camera;
  NoiseModel noise;
  std::vector<std::uint16_t> depth;
  std::vector<std::uint8_t> gray;

  Image(int w, int h)
      : width{w},
        height{h},
        camera{w, h, 585.0 * w / 640, 585.0 * w / 640, w / 2.0, h / 2.0},
        depth(static_cast<std::size_t>(w * h)) {
    noise.correlated_px = 1.0;
    noise.lateral_px = noise.disparity_step = 0.0;
  }

  /// Draws theta . m = 1/Z, with white noise of `sigmas` standard deviations of the noise model,
  /// into the pixels that `where(u, v)` picks.
  template <class Where>
  void draw(const Eigen::Vector3d& theta, double sigmas, std::mt19937& rng, Where where) {
    std::normal_distribution<double> normal;
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        if (!where(u, v)) continue;
        const double truth = theta.dot(camera.ray(u, v));
        const double w = truth + sigmas * noise.sigma_inverse_depth(truth) * normal(rng);
        const double units = w > 0.0 ? std::round(1.0 / (w * metres_per_unit)) : 0.0;
        depth[static_cast<std::size_t>(v * width + u)] =
            units < 65535.0 ? static_cast<std::uint16_t>(units) : 0;
      }
    }
  }
  void draw(const Eigen::Vector3d& theta, double sigmas, std::mt19937& rng) {
    draw(theta, sigmas, rng, [](int, int) { return true; });
  }
  /// Draws what a sensor makes of it that reads depth noise.lateral_px beside each pixel, adds
  /// white noise of `dither` steps to the disparity and rounds it to steps, as Handa et al. do.
  void draw_stepped(const Eigen::Vector3d& theta, double dither, std::mt19937& rng) {
    std::normal_distribution<double> normal;
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        const double du = noise.lateral_px * normal(rng), dv = noise.lateral_px * normal(rng);
        const double w = theta.dot(camera.ray(u + du, v + dv));
        const double steps = std::round(w / noise.disparity_step + dither * normal(rng));
        const double units = std::round(1.0 / (steps * noise.disparity_step * metres_per_unit));
        depth[static_cast<std::size_t>(v * width + u)] =
            units > 0.0 && units < 65535.0 ? static_cast<std::uint16_t>(units) : 0;
      }
    }
  }

  [[nodiscard]] DepthFrame frame() const {
    DepthFrame f;
    f.depth = {depth.data(), width, height, width};
    f.metres_per_unit = metres_per_unit;
    f.camera = camera;
    f.noise = noise;
    if (!gray.empty()) f.gray = {gray.data(), width, height, width};
    return f;
  }
};

}  // namespace maplet::test
