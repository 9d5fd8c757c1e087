// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/extractor.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "tests/unit/patches/synthetic.hpp"

namespace maplet {
namespace {

using test::Image;

const Eigen::Vector3d kWall{0.05, -0.1, 0.5};  // 2 m ahead
const Eigen::Vector3d kFloor{0.0, 1.2, 0.3};   // 0.8 m below

double angle_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::acos(std::min(1.0, a.normalized().dot(b.normalized()))) * 180.0 / std::numbers::pi;
}

class Extractor : public testing::Test {
 protected:
  const PatchSet& run(const DepthFrame& frame) { return extractor_.run(frame, Deadline::never()); }

  std::mt19937 rng_{1};
  Arena arena_;
  PatchExtractor extractor_{PatchConfig{}, arena_};
};

TEST_F(Extractor, OneWallIsOnePlaneOfAllPixels) {
  Image image{640, 480};
  image.draw(kWall, 1.0, rng_);
  const PatchSet& set = run(image.frame());
  ASSERT_EQ(set.planes.size(), 1u);
  EXPECT_EQ(set.stop, Stop::kConverged);
  EXPECT_EQ(set.valid_pixels, 640u * 480u);
  EXPECT_EQ(set.planes[0].pixels, 640u * 480u);
  EXPECT_LT(angle_deg(set.planes[0].theta, kWall), 0.02);
  EXPECT_NEAR(set.planes[0].plane().d, Plane::from_theta(kWall).d, 0.0004);
}

TEST_F(Extractor, WallAndFloorMeetInACrease) {
  Image image{640, 480};
  image.draw(kWall, 1.0, rng_);
  image.draw(kFloor, 1.0, rng_, [&](int u, int v) {
    const Eigen::Vector3d m = image.camera.ray(u, v);
    return kFloor.dot(m) > kWall.dot(m);
  });
  const PatchSet& set = run(image.frame());
  ASSERT_GE(set.planes.size(), 2u);
  EXPECT_LT(angle_deg(set.planes[0].theta, kWall), 0.05);
  EXPECT_LT(angle_deg(set.planes[1].theta, kFloor), 0.05);
  EXPECT_EQ(set.plane_at(320, 40), 0);
  EXPECT_EQ(set.plane_at(320, 470), 1);
  EXPECT_EQ(set.plane_at(-3, 470), Patch::kNoPlane);
  EXPECT_EQ(set.plane_at(320, 480), Patch::kNoPlane);
}

TEST_F(Extractor, NoPatchStraddlesADepthStep) {
  Image image{320, 240};
  image.draw({0.0, 0.0, 0.4}, 1.0, rng_);
  image.draw({0.0, 0.0, 0.7}, 1.0, rng_, [](int u, int v) { return u > 101 && u < 203 && v > 51; });
  const PatchSet& set = run(image.frame());
  ASSERT_EQ(set.planes.size(), 2u);
  for (const Patch& patch : set.patches) {
    const bool behind =
        angle_deg(patch.theta, {0, 0, 1}) < 5 && std::abs(patch.theta.z() - 0.4) < 0.05;
    const bool ahead =
        angle_deg(patch.theta, {0, 0, 1}) < 5 && std::abs(patch.theta.z() - 0.7) < 0.05;
    EXPECT_TRUE(behind || ahead) << patch.theta.transpose() << " at " << patch.u_px << ", "
                                 << patch.v_px;
  }
}

TEST_F(Extractor, InformationMatchesTheError) {
  double nees = 0.0;
  int count = 0;
  for (int k = 0; k < 20; ++k) {
    Image image{320, 240};
    image.draw(kWall, 1.0, rng_);
    const PatchSet& set = run(image.frame());
    for (const Patch& patch : set.patches) {
      const Eigen::Vector3d error = patch.theta - kWall;
      nees += error.dot(patch.information * error) / 3.0;
      ++count;
    }
  }
  EXPECT_NEAR(nees / count, 1.0, 0.2) << count;
}

/// A floor that runs away under a camera close to it: its slope makes lateral noise the largest.
TEST_F(Extractor, GrazedFloorIsOnePlane) {
  const Eigen::Vector3d grazed{0.0, 4.5, 0.6};
  double nees = 0.0;
  for (int k = 0; k < 10; ++k) {
    Image image{320, 240};
    image.noise.lateral_px = 0.5;
    image.noise.disparity_step = 2.85e-3;
    image.camera.cy_px = 20.0;
    image.draw_stepped(grazed, 1.0 / 6.0, rng_);
    const PatchSet& set = run(image.frame());
    ASSERT_EQ(set.planes.size(), 1u);
    EXPECT_GT(set.planes[0].pixels, 0.97 * 320 * 240);
    EXPECT_LT(angle_deg(set.planes[0].theta, grazed), 0.05);
    const Eigen::Vector3d error = set.planes[0].theta - grazed;
    nees += error.dot(set.planes[0].information * error) / 3.0;
  }
  EXPECT_LT(nees / 10, 2.0);
}

/// Square on, all pixels of a wall lie in one or two steps of disparity and err alike.
TEST_F(Extractor, InformationKnowsOfStepsThatErrAlike) {
  std::uniform_real_distribution<double> depth{1.2, 3.5}, slope{-0.004, 0.004};
  double planes = 0.0, patches = 0.0, worst = 0.0;
  int patch_count = 0;
  constexpr int kFrames = 60;
  for (int k = 0; k < kFrames; ++k) {
    Image image{320, 240};
    image.noise.disparity_step = 2.85e-3;
    image.noise.disparity_k = 2.85e-3 / 3.0;
    const Eigen::Vector3d wall{slope(rng_), slope(rng_), 1.0 / depth(rng_)};
    image.draw_stepped(wall, 1.0 / 6.0, rng_);
    const PatchSet& set = run(image.frame());
    ASSERT_GE(set.planes.size(), 1u);
    const auto nees = [&](const auto& found) {
      const Eigen::Vector3d error = found.theta - wall;
      return error.dot(found.information * error) / 3.0;
    };
    planes += nees(set.planes[0]);
    worst = std::max(worst, nees(set.planes[0]));
    for (const Patch& patch : set.patches) {
      patches += nees(patch);
      ++patch_count;
    }
  }
  EXPECT_LT(planes / kFrames, 2.0);
  EXPECT_LT(patches / patch_count, 2.0);
  EXPECT_LT(worst, 25.0);
}

TEST_F(Extractor, EmptyInputHasAnEmptyResult) {
  Image image{64, 48};
  EXPECT_TRUE(run(image.frame()).patches.empty());
  DepthFrame none;
  EXPECT_TRUE(run(none).patches.empty());
  image.draw(kWall, 0.0, rng_);
  DepthFrame blind = image.frame();
  blind.camera.fx_px = 0.0;
  EXPECT_TRUE(run(blind).patches.empty());
  EXPECT_FALSE(run(image.frame()).patches.empty());
}

}  // namespace
}  // namespace maplet
