// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/contour.hpp"

#include <gtest/gtest.h>

namespace maplet::draw {
namespace {

using Eigen::Vector2d;

/// Signed area of a closed outline.
double area_of(const Polyline& line) {
  double twice = 0.0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const Vector2d& a = line[i];
    const Vector2d& b = line[(i + 1) % line.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return twice / 2.0;
}

Bounds box(double size_m) {
  Bounds bounds;
  bounds.include({0, 0});
  bounds.include({size_m, size_m});
  return bounds;
}

void cover(CoverGrid& grid, double x0, double y0, double x1, double y1) {
  for (double x = x0; x <= x1; x += 0.02) {
    for (double y = y0; y <= y1; y += 0.02) grid.cover({x, y});
  }
}

TEST(CoverGrid, OutlinesASquare) {
  CoverGrid grid{box(4.0), 0.05};
  cover(grid, 1.0, 1.0, 3.0, 3.0);
  const auto lines = grid.outlines();
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_NEAR(std::abs(area_of(lines[0])), 4.0, 0.25);
  EXPECT_NEAR(grid.covered_m2(), 4.0, 0.25);
  for (const Vector2d& p : lines[0]) {
    EXPECT_GT(p.minCoeff(), 0.9);
    EXPECT_LT(p.maxCoeff(), 3.1);
  }
}

TEST(CoverGrid, KeepsHolesAndClosesGaps) {
  CoverGrid grid{box(4.0), 0.05};
  cover(grid, 0.5, 0.5, 3.5, 1.0);
  cover(grid, 0.5, 3.0, 3.5, 3.5);
  cover(grid, 0.5, 0.5, 1.0, 3.5);
  cover(grid, 3.0, 0.5, 3.5, 1.95);  // a slit of 10 cm in the frame's right side
  cover(grid, 3.0, 2.05, 3.5, 3.5);
  EXPECT_EQ(grid.outlines().size(), 1u);  // open by the slit
  grid.smooth(0.15);
  const auto lines = grid.outlines();
  ASSERT_EQ(lines.size(), 2u);                            // outside and hole
  EXPECT_LT(area_of(lines[0]) * area_of(lines[1]), 0.0);  // they run opposite ways
}

TEST(CoverGrid, IgnoresWhatIsOutside) {
  CoverGrid grid{box(1.0), 0.05};
  grid.cover({50.0, 0.5});
  grid.cover({0.5, -50.0});
  grid.cover({1e300, 1e300});
  EXPECT_TRUE(grid.outlines().empty());
}

TEST(CoverGrid, CoarsensInsteadOfGrowing) {
  CoverGrid grid{box(10'000.0), 0.01};  // would be 1e12 cells
  cover(grid, 5000, 5000, 5000.1, 5000.1);
  EXPECT_GT(grid.covered_m2(), 10.0);  // one wide cell
}

TEST(Simplified, KeepsCornersOnly) {
  Polyline line;
  for (int i = 0; i <= 10; ++i) line.emplace_back(i, 0.0);
  for (int i = 1; i <= 10; ++i) line.emplace_back(10.0, i);
  const Polyline out = simplified(line, 0.01);
  ASSERT_EQ(out.size(), 3u);
  EXPECT_EQ(out[1], (Vector2d{10.0, 0.0}));
  EXPECT_EQ(simplified({{1, 1}}, 0.1).size(), 1u);
}

}  // namespace
}  // namespace maplet::draw
