// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/geometry/direction_code.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <random>

namespace maplet {
namespace {

TEST(DirectionCode, ErrorIsBoundedAndAxesAreExact) {
  std::mt19937 rng{5};
  std::normal_distribution<double> normal;
  double worst = 0.0;
  for (int i = 0; i < 200000; ++i) {
    const Eigen::Vector3d n = Eigen::Vector3d{normal(rng), normal(rng), normal(rng)}.normalized();
    worst = std::max(worst, n.cross(unpack_direction(pack_direction(n))).norm());
  }
  EXPECT_LT(worst, 6.6e-5);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double s : {-1.0, 1.0}) {
      const Eigen::Vector3d n = s * Eigen::Vector3d::Unit(axis);
      EXPECT_EQ(n, unpack_direction(pack_direction(n)));
    }
  }
}

// Who packs what was unpacked says the same plane.
TEST(DirectionCode, GivesTheSameCodeAgain) {
  std::mt19937 rng{6};
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector3d n = Eigen::Vector3d{normal(rng), normal(rng), normal(rng)}.normalized();
    const std::uint32_t code = pack_direction(n);
    EXPECT_EQ(pack_direction(unpack_direction(code)), code);
  }
}

}  // namespace
}  // namespace maplet
