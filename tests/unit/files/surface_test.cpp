// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/files/surface.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace maplet::files {
namespace {

/// One plane with this pattern of cells, 0.1 m wide.
std::unique_ptr<Maplet> patterned(const std::vector<std::string>& rows) {
  auto maplet = std::make_unique<Maplet>();
  maplet->cell_m = 0.1;
  MapletPlane plane;
  plane.plane = {Eigen::Vector3d{1, 2, -4}.normalized(), 2.0};
  plane.mean_gray = 90.0F;
  plane.grid.axis = PlaneBasis::best_axis(plane.plane.n);
  plane.grid.column0 = -3;
  plane.grid.row0 = 5;
  plane.grid.rows = static_cast<std::uint16_t>(rows.size());
  plane.grid.columns = static_cast<std::uint16_t>(rows[0].size());
  EXPECT_TRUE(maplet->take_cells(plane.grid));
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t c = 0; c < rows[r].size(); ++c) {
      if (rows[r][c] == '#') maplet->set_cell(plane.grid, static_cast<int>(c), static_cast<int>(r));
    }
  }
  maplet->measure_extent(plane);
  maplet->planes.push_back(plane);
  return maplet;
}

TEST(Surface, IsWhatTheCellsCover) {
  const auto maplet = patterned({"##.#", "....", "####"});
  const auto surfaces = surfaces_of(*maplet);
  ASSERT_EQ(surfaces.size(), 1u);
  ASSERT_EQ(surfaces[0].strips.size(), 3u);
  EXPECT_EQ(surfaces[0].mean_gray, 90.0F);
  double area_m2 = 0.0;
  for (const Strip& strip : surfaces[0].strips) {
    const Eigen::Vector3d cross = strip.along.cross(strip.across);
    area_m2 += cross.norm();
    EXPECT_GT(cross.dot(surfaces[0].plane.n), 0.0);
    for (double s : {0.02, 0.5, 0.98}) {
      const Eigen::Vector3d p = strip.corner + s * strip.along + s * strip.across;
      EXPECT_NEAR(surfaces[0].plane.distance(p), 0.0, 1e-12);
      EXPECT_TRUE(maplet->covers(maplet->planes[0], p));
    }
    EXPECT_FALSE(maplet->covers(
        maplet->planes[0], strip.corner - 0.1 * strip.along.normalized() + 0.5 * strip.across));
  }
  EXPECT_NEAR(area_m2, surfaces[0].area_m2, 1e-12);
}

TEST(Surface, MovesWithItsPlane) {
  const Surface b = surfaces_of(*patterned({"##"}))[0];
  const Se3 T{Eigen::Quaterniond{Eigen::AngleAxisd{1.0, Eigen::Vector3d::UnitX()}},
              Eigen::Vector3d{1, 2, 3}};
  const Surface a = moved(T, b);
  ASSERT_EQ(a.strips.size(), 1u);
  EXPECT_NEAR(a.plane.distance(a.strips[0].corner + a.strips[0].along), 0.0, 1e-12);
  EXPECT_LT((a.strips[0].corner - T * b.strips[0].corner).norm(), 1e-12);
  EXPECT_LT((a.plane.n - T.q * b.plane.n).norm(), 1e-12);
}

}  // namespace
}  // namespace maplet::files
