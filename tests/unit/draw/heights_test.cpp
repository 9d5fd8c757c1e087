// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/heights.hpp"

#include <gtest/gtest.h>

namespace maplet::draw {
namespace {

using Eigen::Vector3d;

Bounds plan() {
  Bounds bounds;
  bounds.include({0, 0});
  bounds.include({6, 4});
  return bounds;
}

/// A part of the wall y = 2.
void add_wall(HeightGrid& grid, double x0, double x1, double z0, double z1, double y = 2.0) {
  const files::Strip strip{Vector3d{x0, y, z0}, Vector3d{x1 - x0, 0, 0}, Vector3d{0, 0, z1 - z0}};
  sample(strip, 0.02, [&](const Vector3d& p) { grid.add(p); });
}

TEST(HeightGrid, TellsWallsFromLowThings) {
  HeightGrid grid{plan(), 0.03};
  add_wall(grid, 1, 2, -1.2, 1.2);
  add_wall(grid, 3, 5, -1.2, -0.7);
  const double low_m2 = grid.at_least(0.2).covered_m2();
  const double high_m2 = grid.at_least(1.4).covered_m2();
  EXPECT_NEAR(high_m2, 1.0 * 0.09, 0.015);  // three squares thick
  EXPECT_NEAR(low_m2, 3.0 * 0.09, 0.03);
  EXPECT_EQ(grid.at_least(3.0).covered_m2(), 0.0);
}

TEST(HeightGrid, CountsAHeightOnce) {
  HeightGrid grid{plan(), 0.03};
  for (int i = 0; i < 20; ++i) add_wall(grid, 1, 2, 0.0, 0.5);
  EXPECT_EQ(grid.at_least(0.7).covered_m2(), 0.0);
}

TEST(HeightGrid, PutsPiecesTogether) {
  HeightGrid grid{plan(), 0.03};
  add_wall(grid, 1, 2, -1.0, 0.0, 2.00);
  add_wall(grid, 1, 2, 0.0, 1.0, 2.03);
  EXPECT_GT(grid.at_least(1.4).covered_m2(), 0.05);
}

TEST(HeightGrid, LeavesOutWhatIsOutside) {
  HeightGrid grid{plan(), 0.03};
  add_wall(grid, 20, 22, 0.0, 2.0);
  add_wall(grid, 1, 2, 0.0, 2.0, -500.0);
  EXPECT_EQ(grid.at_least(0.1).covered_m2(), 0.0);
}

}  // namespace
}  // namespace maplet::draw
