// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/extent.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "core/patches/extractor.hpp"
#include "tests/unit/patches/synthetic.hpp"

namespace maplet {
namespace {

using test::Image;

TEST(Extent, QuadrangleIsThePatchOnItsPlane) {
  Patch patch{};
  patch.theta = {0.1, -0.2, 0.5};
  patch.u_px = 32, patch.v_px = 64, patch.width_px = 16, patch.height_px = 8;
  const CameraModel camera{640, 480, 585.0, -585.0, 320.0, 240.0};
  const auto corners = quadrangle(patch, camera);
  const double u[] = {31.5, 47.5, 47.5, 31.5};
  const double v[] = {63.5, 63.5, 71.5, 71.5};
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_NEAR(patch.theta.dot(corners[k]), 1.0, 1e-12);
    EXPECT_LT((camera.project(corners[k]) - Eigen::Vector2d(u[k], v[k])).norm(), 1e-9);
  }
}

TEST(Extent, WallsPolygonIsTheImagesFrame) {
  std::mt19937 rng{1};
  Image image{320, 240};
  const Eigen::Vector3d wall{0.05, -0.1, 0.5};
  image.draw(wall, 1.0, rng);
  Arena arena;
  PatchExtractor extractor{PatchConfig{}, arena};
  const PatchSet& set = extractor.run(image.frame(), Deadline::never());
  ASSERT_EQ(set.planes.size(), 1u);
  const PlaneExtent polygon = extent(set, 0);
  ASSERT_EQ(polygon.size(), 4u);
  for (const Eigen::Vector3d& p : polygon) {
    EXPECT_NEAR(set.planes[0].theta.dot(p), 1.0, 1e-9);
    const Eigen::Vector2d px = set.camera.project(p);
    EXPECT_NEAR(std::abs(px.x() - 159.5), 160.0, 1e-6);
    EXPECT_NEAR(std::abs(px.y() - 119.5), 120.0, 1e-6);
  }
}

TEST(Extent, HoldsAllPatchesOfATrianglesHalf) {
  std::mt19937 rng{1};
  Image image{320, 240};
  image.draw({0.0, 0.0, 0.4}, 1.0, rng, [](int u, int v) { return 3 * u < 4 * v; });
  Arena arena;
  PatchExtractor extractor{PatchConfig{}, arena};
  const PatchSet& set = extractor.run(image.frame(), Deadline::never());
  ASSERT_EQ(set.planes.size(), 1u);
  const PlaneExtent polygon = extent(set, 0);
  ASSERT_GE(polygon.size(), 3u);
  double doubled = 0.0;  // shoelace, px^2: clockwise on the screen is positive with v down
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Eigen::Vector2d a = set.camera.project(polygon[k]);
    const Eigen::Vector2d b = set.camera.project(polygon[(k + 1) % polygon.size()]);
    doubled += a.x() * b.y() - a.y() * b.x();
  }
  // Patches along the border reach half a patch beyond it: half their pixels may have no depth.
  EXPECT_GT(doubled / 2.0, 0.98 * 320.0 * 240.0 / 2.0);
  EXPECT_LT(doubled / 2.0, 1.30 * 320.0 * 240.0 / 2.0);
}

TEST(Extent, PlaneWithoutPatchesHasNone) {
  const auto set = std::make_unique<PatchSet>();
  set->planes.emplace_back();
  EXPECT_TRUE(extent(*set, 0).empty());
}

}  // namespace
}  // namespace maplet
