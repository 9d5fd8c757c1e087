// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The photometric sums of this processor against the plain ones.
#include "core/odometry/photo_sums.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace maplet {
namespace {

const CameraModel kCamera{96, 72, 80.0, 82.0, 47.5, 35.5};

// A noisy image, and points before, beside and behind it, some without a place.
struct Scene {
  std::vector<std::uint8_t> pixels;
  std::vector<PhotoPoint> points;
  Se3 T_camera_reference, T_gray_depth;

  Scene(std::uint32_t seed, std::size_t count) {
    std::mt19937 rng{seed};
    std::uniform_real_distribution<float> unit{-1.0F, 1.0F};
    for (int i = 0; i < kCamera.width_px * kCamera.height_px; ++i) {
      pixels.push_back(static_cast<std::uint8_t>(rng() % 256));
    }
    for (std::size_t i = 0; i < count; ++i) {
      const float z = rng() % 8 == 0 ? unit(rng) : 2.0F + unit(rng);
      points.push_back({{unit(rng) * z, unit(rng) * z, z}, static_cast<float>(rng() % 256)});
      if (rng() % 16 == 0) points.back().p.x() = std::numeric_limits<float>::quiet_NaN();
    }
    Vector6d xi;
    for (int i = 0; i < 6; ++i) xi[i] = 0.05F * unit(rng);
    T_camera_reference = Se3::exp(xi);
    T_gray_depth = seed % 2 == 0 ? Se3{} : Se3::exp(Vector6d{-0.5 * xi});
  }
  [[nodiscard]] PhotoLook look() const {
    return {T_camera_reference, T_gray_depth, GrayPyramid::Level{pixels.data(), kCamera}};
  }
};

void expect_near(float is, float was, float scale) { EXPECT_NEAR(is, was, 2e-4F * scale + 1e-6F); }

void expect_same_sums(const Scene& scene, const Brightness& by) {
  const PhotoLook look = scene.look();
  const IntensitySums x = kPhotoBest.intensities(look, scene.points, by);
  const IntensitySums x0 = kPhotoPlain.intensities(look, scene.points, by);
  expect_near(x.n, x0.n, x0.n);
  expect_near(x.x, x0.x, x0.x);
  expect_near(x.y, x0.y, x0.y);
  expect_near(x.xx, x0.xx, x0.xx);
  expect_near(x.xy, x0.xy, x0.xy);
  const SpreadSums s = kPhotoBest.spread(look, scene.points, by);
  const SpreadSums s0 = kPhotoPlain.spread(look, scene.points, by);
  expect_near(s.squared, s0.squared, s0.squared);
  EXPECT_EQ(s.count, s0.count);
  const PhotoEquations e = kPhotoBest.equations(look, scene.points, by);
  const PhotoEquations e0 = kPhotoPlain.equations(look, scene.points, by);
  EXPECT_EQ(e.seen, e0.seen);
  EXPECT_EQ(e.kept, e0.kept);
  for (int j = 0; j < 6; ++j) {
    for (int i = j; i < 6; ++i) {
      expect_near(e.H(i, j), e0.H(i, j), std::sqrt(e0.H(i, i) * e0.H(j, j)));
    }
    expect_near(e.b[j], e0.b[j], std::sqrt(e0.H(j, j) * s0.squared));
  }
}

TEST(PhotoSums, FastVariantDiffersByRounding) {
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    // Any number of points: four at a time leave one, two or three.
    const Scene scene{seed, 1 + seed * 33};
    expect_same_sums(scene, {1.0F, 0.0F, 12.0F});
    expect_same_sums(scene, {0.6F, 15.0F, 2.0F});
    if (seed > 2) {
      EXPECT_GT(kPhotoBest.equations(scene.look(), scene.points, {1, 0, 9}).seen, 20);
    }
  }
}

TEST(PhotoSums, NoPointInTheImageGivesNothing) {
  Scene scene{1, 7};
  for (PhotoPoint& point : scene.points) point.p = {0.0F, 0.0F, -1.0F};
  for (const PhotoVariant* variant : {&kPhotoPlain, &kPhotoBest}) {
    const PhotoEquations e = variant->equations(scene.look(), scene.points, {1.0F, 0.0F, 2.0F});
    EXPECT_EQ(e.seen, 0) << variant->name;
    EXPECT_TRUE(e.H.isZero(0.0F)) << variant->name;
    EXPECT_EQ(variant->spread(scene.look(), scene.points, {1.0F, 0.0F, 2.0F}).count, 0.0F);
    EXPECT_EQ(variant->intensities(scene.look(), {}, {1.0F, 0.0F, 2.0F}).n, 0.0F);
  }
}

}  // namespace
}  // namespace maplet
