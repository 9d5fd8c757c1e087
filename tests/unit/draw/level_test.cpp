// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/level.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <vector>

#include "tests/support/synthetic_run.hpp"

namespace maplet::draw {
namespace {

using Eigen::Vector3d;
using files::Surface;

const Vector3d kHint = -Vector3d::UnitY();

Surface surface(const Vector3d& n, double area_m2) {
  return {{n.normalized(), 1.0}, area_m2, -1, {}};
}

/// The panels of the flat, as surfaces without cells.
std::vector<Surface> flat_surfaces(double tilt_rad) {
  std::vector<Surface> out;
  for (const test::Panel& panel : test::flat(tilt_rad)) {
    const Vector3d cross = panel.a.cross(panel.b);
    out.push_back(surface(cross, cross.norm()));
  }
  return out;
}

double degrees_between(const Vector3d& a, const Vector3d& b) {
  return std::acos(std::clamp(a.dot(b), -1.0, 1.0)) * 180.0 / 3.14159265358979;
}

TEST(FindUp, FindsTheFloorUnderATiltedCamera) {
  for (const double tilt_rad : {-0.5, 0.0, 0.3, 0.6}) {
    const Vector3d truth = Eigen::AngleAxisd{tilt_rad, Vector3d::UnitX()} * kHint;
    EXPECT_LT(degrees_between(find_up(flat_surfaces(tilt_rad), kHint), truth), 0.1) << tilt_rad;
  }
}

TEST(FindUp, AveragesNoisyPlanes) {
  const std::vector<Surface> surfaces{surface({0.05, -1, 0}, 2.0), surface({-0.05, -1, 0}, 2.0),
                                      surface({0, 1, 0.04}, 1.0), surface({0, 1, -0.04}, 1.0)};
  EXPECT_LT(degrees_between(find_up(surfaces, kHint), kHint), 0.1);
}

TEST(FindUp, TakesWallsWhereThereIsNoFloor) {
  const Vector3d truth = Vector3d{0.3, -1, 0.2}.normalized();
  const Vector3d wall_a = truth.cross(Vector3d::UnitX()).normalized();
  const Vector3d wall_b = truth.cross(wall_a);
  EXPECT_LT(
      degrees_between(find_up(std::vector{surface(wall_a, 3), surface(wall_b, 4)}, kHint), truth),
      0.1);
}

TEST(FindUp, PrefersTheLargeFloorToASmallSlope) {
  const std::vector<Surface> surfaces{surface({0, -1, 0.1}, 5.0), surface({0.5, -1, 0}, 1.0)};
  EXPECT_LT(degrees_between(find_up(surfaces, kHint), Vector3d{0, -1, 0.1}.normalized()), 0.1);
}

TEST(FindUp, KeepsTheHintWhenNothingTells) {
  EXPECT_EQ(find_up({}, kHint), kHint);
  // A wall dead ahead is upright already: it tells no more.
  EXPECT_LT(degrees_between(find_up(std::vector{surface({0, 0, -1}, 9.0)}, kHint), kHint), 0.1);
}

TEST(LayOut, PutsWallsAlongThePage) {
  const Eigen::Matrix3d turned{Eigen::AngleAxisd{0.4, Vector3d::UnitY()}};
  const std::vector<Surface> surfaces{surface(turned * Vector3d{1, 0, 0}, 5.0),
                                      surface(turned * Vector3d{0, 0, -1}, 3.0),
                                      surface({0, -1, 0}, 50.0)};
  const Eigen::Matrix3d axes = lay_out(surfaces, kHint, Vector3d::UnitZ());
  EXPECT_LT((axes * axes.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_NEAR(axes.determinant(), 1.0, 1e-12);
  EXPECT_LT((axes.row(2).transpose() - kHint).norm(), 1e-12);
  EXPECT_GT(axes.row(1).dot(turned * Vector3d::UnitZ()), 0.9999);  // first camera looks to the top
}

}  // namespace
}  // namespace maplet::draw
