// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/walls.hpp"

#include <gtest/gtest.h>

namespace maplet::draw {
namespace {

using Eigen::Vector3d;

/// A part of the wall y = 2, from x0 to x1, z0 to z1.
files::Strip part(double x0, double x1, double z0, double z1) {
  return {Vector3d{x0, 2.0, z0}, Vector3d{x1 - x0, 0, 0}, Vector3d{0, 0, z1 - z0}};
}

files::Surface wall(std::vector<files::Strip> strips) {
  return {{Vector3d{0, -1, 0}, 2.0}, 0.0, -1.0F, std::move(strips)};
}

TEST(StretchesOf, LeaveTheDoorOpen) {
  const auto out = stretches_of(wall({part(0, 2, 0, 2.4), part(3, 5, 0, 2.4)}));
  ASSERT_EQ(out.size(), 2u);
  double length_m = 0.0;
  for (const WallStretch& stretch : out) {
    length_m += (stretch.to - stretch.from).norm();
    EXPECT_NEAR(stretch.from.y(), 2.0, 1e-9);
    EXPECT_NEAR(stretch.high_m, 2.4, 0.15);
  }
  EXPECT_NEAR(length_m, 4.0, 0.25);
}

TEST(StretchesOf, CloseSmallGaps) {
  EXPECT_EQ(stretches_of(wall({part(0, 2, 0, 2.4), part(2.07, 5, 0, 2.4)})).size(), 1u);
}

TEST(StretchesOf, TellWallsFromLowThings) {
  const auto out = stretches_of(wall({part(0, 2, 0, 2.4), part(2, 4, 0, 0.5)}));
  ASSERT_EQ(out.size(), 2u);
  EXPECT_NEAR(std::max(out[0].high_m, out[1].high_m), 2.4, 0.15);
  EXPECT_NEAR(std::min(out[0].high_m, out[1].high_m), 0.5, 0.1);
}

TEST(StretchesOf, SlantedStripsAreNoHigherThanWhatTheyCover) {
  // A diamond: rows of cells that run at 45 degrees.
  const Vector3d a = Vector3d{1, 0, 1}.normalized();
  const Vector3d b = Vector3d{-1, 0, 1}.normalized();
  const auto out = stretches_of(wall({{Vector3d{0, 2, 0}, a, b}}));
  ASSERT_FALSE(out.empty());
  double area_m2 = 0.0;
  for (const WallStretch& s : out) area_m2 += (s.to - s.from).norm() * s.high_m;
  EXPECT_NEAR(area_m2, 1.0, 0.08);
}

TEST(StretchesOf, DropSpecks) {
  EXPECT_TRUE(stretches_of(wall({part(0, 0.03, 0, 0.05)})).empty());
  EXPECT_TRUE(stretches_of(wall({})).empty());
}

}  // namespace
}  // namespace maplet::draw
