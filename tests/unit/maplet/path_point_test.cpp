// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/path_point.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace maplet {
namespace {

using V = Eigen::Vector3d;

PathPoint at(const Se3& T, double sigma) {
  PathPoint p;
  p.maplet = {1, 2, 3};
  p.T_maplet_camera = Transform<MapletFrame, CameraFrame>{T};
  p.covariance = sigma * sigma * Matrix6d::Identity();
  return p;
}

TEST(CarriedRange, AtTheOriginIsTheRangeItself) {
  const CarriedRange c = carry_to_origin(at({}, 0.0), {7.0, 0.1, V::Zero(), 0.0});
  EXPECT_EQ(c.maplet, (MapletKey{1, 2, 3}));
  EXPECT_EQ(c.range_m, 7.0);
  EXPECT_EQ(c.sigma_m, 0.1);
}

// The other agent stands still; the range is measured 1 m beside the origin.
TEST(CarriedRange, WithABearingItsErrorsAreAsSaid) {
  std::mt19937 rng{3};
  std::normal_distribution<double> normal;
  const V other{1.0, 0.5, 6.0};
  constexpr double kPath = 0.02;
  constexpr double kRange = 0.05;
  constexpr double kBearing = 0.03;
  double squares = 0.0;
  constexpr int kRuns = 2000;
  for (int i = 0; i < kRuns; ++i) {
    Vector6d xi;
    for (int k = 0; k < 6; ++k) xi[k] = kPath * normal(rng);
    const Se3 truth = Se3::exp((Vector6d() << 1.0, 0.1, 0.3, 0.0, 0.4, 0.1).finished());
    const V seen = truth.inverse() * other;
    RangeMeasurement m;
    m.range_m = seen.norm() + kRange * normal(rng);
    m.sigma_m = kRange;
    m.bearing = (seen.normalized() + kBearing * V{normal(rng), normal(rng), normal(rng)});
    m.bearing.normalize();
    m.bearing_sigma_rad = kBearing;
    const CarriedRange c = carry_to_origin(at(truth * Se3::exp(xi), kPath), m);
    squares += std::pow((c.range_m - other.norm()) / c.sigma_m, 2);
  }
  EXPECT_NEAR(squares / kRuns, 1.0, 0.15);
}

TEST(CarriedRange, WithoutABearingAnyDirectionIsAllowedFor) {
  std::mt19937 rng{4};
  std::normal_distribution<double> normal;
  const Se3 T{Eigen::Quaterniond::Identity(), V{0.6, 0.0, 0.8}};
  double squares = 0.0;
  double sum = 0.0;
  constexpr int kRuns = 4000;
  for (int i = 0; i < kRuns; ++i) {
    const V direction = V{normal(rng), normal(rng), normal(rng)}.normalized();
    const CarriedRange c = carry_to_origin(at(T, 0.0), {5.0, 0.1, V::Zero(), 0.0});
    const double truth = (T.t + (5.0 + 0.1 * normal(rng)) * direction).norm();
    sum += truth - c.range_m;
    squares += std::pow((truth - c.range_m) / c.sigma_m, 2);
  }
  EXPECT_NEAR(sum / kRuns, 0.0, 0.03);
  EXPECT_NEAR(squares / kRuns, 1.0, 0.1);
}

}  // namespace
}  // namespace maplet
