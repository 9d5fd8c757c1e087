// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/geometry/planar_motion.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "tests/support/maplets.hpp"

namespace maplet {
namespace {

const Eigen::Vector3d kLevel{0.0, -1.0, 0.0};
// As a code holds it.
const Eigen::Vector3d kTilted = PlanarMotion{Eigen::Vector3d{0.1, -0.9, -0.4}.normalized()}.up();

Se3 in_plane(const PlanarMotion& planar, std::mt19937& rng) {
  std::normal_distribution<double> normal;
  const Eigen::Vector3d y{normal(rng), normal(rng), normal(rng)};
  return Se3::exp(planar.basis() * y);
}

TEST(PlanarMotion, IsAGroupThatProjectionLeavesAlone) {
  std::mt19937 rng{1};
  for (const Eigen::Vector3d& up : {kLevel, kTilted}) {
    const PlanarMotion planar{up};
    for (int i = 0; i < 50; ++i) {
      const Se3 T = in_plane(planar, rng) * in_plane(planar, rng).inverse();
      EXPECT_LT((T.inverse() * planar.project(T)).log().norm(), 1e-9);
      EXPECT_NEAR(up.dot(T.t), 0.0, 1e-9);
      EXPECT_LT((T.q * up - up).norm(), 1e-9);
    }
  }
}

TEST(PlanarMotion, OfALevelCameraIsXZAndTheTurnAboutY) {
  const PlanarMotion planar{kLevel};
  const Se3 T = planar.project(Se3::exp((Vector6d() << 1, 0.2, 2, 0.1, 0.5, -0.1).finished()));
  EXPECT_EQ(T.t.y(), 0.0);
  EXPECT_EQ(T.q.x(), 0.0);
  EXPECT_EQ(T.q.z(), 0.0);
  EXPECT_NEAR(2.0 * std::asin(T.q.y()), 0.5, 0.02);
  const Matrix6d covariance = planar.restrict_covariance(Matrix6d::Identity());
  for (const int i : {1, 3, 5}) {
    for (int k = 0; k < 6; ++k) {
      EXPECT_EQ(covariance(i, k), i == k ? PlanarMotion::kFlat * PlanarMotion::kFlat : 0.0);
    }
  }
}

TEST(PlanarMotion, ItsAxesAreRightForwardAndDown) {
  const PlanarMotion level{kLevel};
  EXPECT_EQ(Eigen::Vector3d{level.basis().col(0).head<3>()}, Eigen::Vector3d::UnitX());
  EXPECT_EQ(Eigen::Vector3d{level.basis().col(1).head<3>()}, Eigen::Vector3d::UnitZ());
  EXPECT_EQ(Eigen::Vector3d{level.basis().col(2).tail<3>()}, Eigen::Vector3d::UnitY());
  std::mt19937 rng{3};
  for (const Eigen::Vector3d& up : {kLevel, kTilted, Eigen::Vector3d{1.0, 0.0, 0.0},
                                    Eigen::Vector3d{0.0, 0.0, 1.0}, Eigen::Vector3d{0, 1, 0}}) {
    const PlanarMotion planar{up};
    const Eigen::Matrix3d gram = planar.basis().transpose() * planar.basis();
    EXPECT_LT((gram - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    for (int i = 0; i < 20; ++i) {
      const Se3 T = in_plane(planar, rng);
      EXPECT_LT((T.inverse() * planar.at(planar.coordinates(T))).log().norm(), 1e-9);
    }
  }
}

TEST(PlanarMotion, WhoeverHoldsTheCodeHoldsThePlane) {
  std::mt19937 rng{4};
  std::normal_distribution<double> normal;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d up = Eigen::Vector3d{normal(rng), normal(rng), normal(rng)}.normalized();
    const PlanarMotion planar{up};
    EXPECT_LT(planar.up().cross(up).norm(), 6.6e-5);
    EXPECT_TRUE(valid(planar.code()));
    EXPECT_NE(planar.code(), PlaneCode::kSpace);
    const PlanarMotion again{planar.code()};
    EXPECT_EQ(again.up(), planar.up());
    EXPECT_EQ(again.basis(), planar.basis());
    EXPECT_EQ(PlanarMotion{planar.up()}.code(), planar.code());
  }
  EXPECT_TRUE(valid(PlaneCode::kSpace));
  EXPECT_FALSE(valid(PlaneCode{0x80000000U}));
}

// A camera that climbs: what is said of its way across is worth less by as much.
TEST(PlanarMotion, WhatIsFarOutOfThePlaneWidensWhatIsSaidOfWithin) {
  const PlanarMotion planar{kTilted};
  const Matrix6d covariance = 1e-6 * Matrix6d::Identity();
  Se3 climbed;
  climbed.t = 0.002 * planar.up();
  EXPECT_NEAR(planar.condition(climbed, covariance).covariance.trace(),
              planar.condition({}, covariance).covariance.trace(), 1e-9);
  climbed.t = 0.1 * planar.up();
  EXPECT_GT(planar.basis().col(0).dot(planar.condition(climbed, covariance).covariance *
                                      planar.basis().col(0)),
            100e-6);
}

// Errors in and out of the plane that go together: the latter tell the former.
TEST(PlanarMotion, ConditioningUsesWhatIsOutOfThePlane) {
  std::mt19937 rng{2};
  std::normal_distribution<double> normal;
  const PlanarMotion planar{kTilted};
  Matrix6d root = 0.01 * Matrix6d::Identity();
  for (int i = 0; i < 6; ++i) root(i, (i + 1) % 6) = 0.008;
  const Matrix6d covariance = root * root.transpose();
  double squares = 0.0;
  double projected_m2 = 0.0;
  double conditioned_m2 = 0.0;
  constexpr int kRuns = 400;
  for (int i = 0; i < kRuns; ++i) {
    const Se3 truth = in_plane(planar, rng);
    Vector6d noise;
    for (int k = 0; k < 6; ++k) noise[k] = normal(rng);
    const Se3 measured = truth * Se3::exp(root * noise);
    const auto held = planar.condition(measured, covariance);
    EXPECT_NEAR(kTilted.dot(held.T.t), 0.0, 1e-9);
    const Vector6d error = (held.T.inverse() * truth).log();
    const Eigen::Vector3d inside = planar.basis().transpose() * error;
    const Eigen::Matrix3d spread = planar.basis().transpose() * held.covariance * planar.basis();
    squares += inside.dot(spread.inverse() * inside) / 3.0;
    conditioned_m2 += inside.squaredNorm();
    projected_m2 += (planar.project(measured).inverse() * truth).log().squaredNorm();
  }
  EXPECT_NEAR(squares / kRuns, 1.0, 0.15);
  EXPECT_LT(conditioned_m2, 0.9 * projected_m2);
}

TEST(PlanarMotion, NoCovarianceAtAllStaysUsable) {
  const PlanarMotion planar{kLevel};
  const auto held = planar.condition({}, Matrix6d::Zero());
  EXPECT_LT(held.T.log().norm(), 1e-12);
  EXPECT_TRUE(held.covariance.allFinite());
}

}  // namespace
}  // namespace maplet
