// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Points of intensity lie where they say: what all of them are off by, no number of them averages.
#include "core/odometry/photo_view.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <vector>

namespace maplet {
namespace {

struct Wave {
  double kx, ky, amplitude, phase;
};

// A wall square to the camera, painted with waves of 8 to 20 pixels.
struct Painting {
  CameraModel camera;
  std::vector<Wave> waves;
  std::vector<std::uint8_t> gray;
  std::vector<std::uint16_t> depth;

  Painting(int width, double noise) {
    const double f = 0.9 * width;
    camera = {width, width * 3 / 4, f, f, 0.5 * width - 0.5, 0.375 * width - 0.5};
    std::mt19937 rng{9};
    std::normal_distribution<double> normal{0.0, std::max(noise, 1e-9)};
    std::uniform_real_distribution<double> unit{0.0, 6.28318};
    for (int i = 0; i < 12; ++i) {
      const double k = 6.28318 / (8.0 + i);
      const double way = unit(rng);
      waves.push_back({k * std::cos(way), k * std::sin(way), 9.0, unit(rng)});
    }
    for (int v = 0; v < camera.height_px; ++v) {
      for (int u = 0; u < width; ++u) {
        gray.push_back(static_cast<std::uint8_t>(
            std::clamp(std::lround(at(u, v, 1) + normal(rng)), 0L, 255L)));
      }
    }
    depth.assign(gray.size(), 2000);
  }
  // The mean over step x step pixels about (u, v), pixels of the whole image; @param du, dv: slopes
  double at(double u, double v, int step, double* du = nullptr, double* dv = nullptr) const {
    double sum = 128.0;
    for (const Wave& w : waves) {
      const double seen = step == 1 ? 1.0 : std::cos(0.5 * w.kx) * std::cos(0.5 * w.ky);
      const double x = w.kx * u + w.ky * v + w.phase;
      sum += seen * w.amplitude * std::sin(x);
      if (du != nullptr) *du += seen * w.amplitude * w.kx * std::cos(x);
      if (dv != nullptr) *dv += seen * w.amplitude * w.ky * std::cos(x);
    }
    return sum;
  }
};

// How far a look for the points of the finest level would end beside them, pixels of that level.
Eigen::Vector2d mean_shift(int width, double noise) {
  const Painting wall{width, noise};
  Arena arena;
  GrayPyramid gray{arena};
  PhotoView points{arena};
  const PatchView nothing_moves{16, arena};
  const auto patches = std::make_unique<PatchSet>();
  DepthFrame frame;
  frame.camera = wall.camera;
  const int height = wall.camera.height_px;
  frame.depth = {wall.depth.data(), width, height, width};
  gray.assign({wall.gray.data(), width, height, width}, wall.camera);
  points.assign(frame, *patches, nothing_moves, gray, Se3{});
  const int step = width / gray.level(0).camera.width_px;
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  EXPECT_GT(points.points(0).size(), 1000u);
  for (const PhotoPoint& point : points.points(0)) {
    const Eigen::Vector2d place = wall.camera.project(point.p.cast<double>());
    Eigen::Vector2d slope = Eigen::Vector2d::Zero();
    const double true_there = wall.at(place.x(), place.y(), step, &slope.x(), &slope.y());
    normal += slope * slope.transpose();
    right += slope * (point.intensity - true_there);
  }
  return normal.inverse() * right / step;
}

// A hundredth of a pixel in each keyframe turned the camera by 0.05 mrad, always the same way.
TEST(PhotoView, PointsLieWhereTheirIntensityIs) {
  for (const double noise : {0.0, 3.0}) {
    for (const int width : {320, 640}) {
      const Eigen::Vector2d shift = mean_shift(width, noise);
      EXPECT_LT(shift.cwiseAbs().maxCoeff(), noise > 0.0 ? 0.012 : 0.004)
          << width << ", noise " << noise << ": " << shift.transpose();
    }
  }
}

}  // namespace
}  // namespace maplet
