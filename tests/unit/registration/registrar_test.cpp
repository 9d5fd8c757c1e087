// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/registrar.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <memory>

#include "tests/support/maplets.hpp"

namespace maplet {
namespace {

PathLink odometry(const Se3& T, double sigma_m, double sigma_rad) {
  PathLink link;
  link.valid = true;
  link.T_previous_this = Transform<MapletFrame, MapletFrame>{T};
  link.covariance.setZero();
  link.covariance.diagonal().head<3>().setConstant(sigma_m * sigma_m);
  link.covariance.diagonal().tail<3>().setConstant(sigma_rad * sigma_rad);
  return link;
}

struct Pair {
  Arena arena;
  Registrar registrar{{}, arena};
  std::unique_ptr<Maplet> a = std::make_unique<Maplet>();
  std::unique_ptr<Maplet> b = std::make_unique<Maplet>();
  Se3 T_a_b;

  explicit Pair(const std::vector<test::Wall>& walls) {
    const Se3 T_world_a = test::camera_at({2.0, 2.5, 1.2}, 0.2);
    const Se3 T_world_b = test::camera_at({2.8, 2.2, 1.25}, 0.5);
    test::fill(*a, walls, T_world_a);
    test::fill(*b, walls, T_world_b);
    b->key.id = 1;
    T_a_b = T_world_a.inverse() * T_world_b;
  }
};

TEST(Registrar, PlanesImproveOnOdometry) {
  Pair p{test::room()};
  std::mt19937 rng{3};
  const Se3 guess = p.T_a_b * Se3::exp(test::normal_tangent(rng, 0.03, 0.01));
  const DeltaPose d = p.registrar.link(*p.a, *p.b, odometry(guess, 0.03, 0.01), Deadline::never());
  EXPECT_EQ(d.b.id, 1U);
  EXPECT_GT(d.matches, 5);
  EXPECT_LT((p.T_a_b.inverse() * d.T_a_b.se3).log().norm(),
            0.3 * (p.T_a_b.inverse() * guess).log().norm());
  EXPECT_LT(d.covariance.trace(), 3 * (0.03 * 0.03 + 0.01 * 0.01));
}

TEST(Registrar, WithoutPlanesOdometryStands) {
  Pair p{{}};
  const DeltaPose d =
      p.registrar.link(*p.a, *p.b, odometry(p.T_a_b, 0.03, 0.01), Deadline::never());
  EXPECT_LT((p.T_a_b.inverse() * d.T_a_b.se3).log().norm(), 1e-12);
  EXPECT_NEAR(d.covariance(0, 0), 0.03 * 0.03, 1e-12);
  EXPECT_EQ(d.matches, 0);
  EXPECT_EQ(p.registrar.counts().odometry_alone, 1U);
}

// A gap of which the turn is known, but not the way: the walls of another place would fit as well.
TEST(Registrar, NothingIsLinkedOverAnUnknownWay) {
  Pair p{test::room()};
  const DeltaPose d = p.registrar.link(*p.a, *p.b, odometry(p.T_a_b, 0.8, 0.01), Deadline::never());
  EXPECT_EQ(d.matches, 0);
  EXPECT_NEAR(d.covariance(0, 0), 0.8 * 0.8, 1e-9);
  EXPECT_EQ(p.registrar.counts().odometry_alone, 1U);
}

// One wall: across it the planes decide, along it the odometry, and the covariance says so.
TEST(Registrar, OdometryFillsFreeAxes) {
  Pair p{{{{5, 2.5, 1.3}, {0, 0, 1.3}, {0, 2.5, 0}}, {{3, 2.5, 0}, {3, 0, 0}, {0, 2.5, 0}}}};
  const Eigen::Vector3d along =
      test::camera_at({2.8, 2.2, 1.25}, 0.5).q.conjugate() * Eigen::Vector3d::UnitY();
  Vector6d slip = Vector6d::Zero();
  slip.head<3>() = 0.05 * along;
  const DeltaPose d = p.registrar.link(*p.a, *p.b, odometry(p.T_a_b * Se3::exp(slip), 0.05, 0.01),
                                       Deadline::never());
  EXPECT_EQ(d.matches, 2);
  const Vector6d off = (p.T_a_b.inverse() * d.T_a_b.se3).log();
  EXPECT_NEAR(off.head<3>().dot(along), 0.05, 0.01);
  EXPECT_GE(along.dot(d.covariance.topLeftCorner<3, 3>() * along), 0.05 * 0.05);
  EXPECT_EQ(p.registrar.counts().with_free_axes, 1U);
}

TEST(Intersect, NeverClaimsMoreThanTheBetterOfTwoCopies) {
  // The same measurement twice is one measurement.
  std::mt19937 rng{8};
  const Se3 T = Se3::exp(test::normal_tangent(rng, 1.0, 0.5));
  const Matrix6d covariance = Vector6d{1e-4, 2e-4, 3e-4, 1e-5, 1e-5, 2e-5}.asDiagonal();
  const FusedTransform f = intersect(T, covariance, T, covariance.inverse());
  EXPECT_LT((f.covariance - covariance).norm(), 1e-9);
  EXPECT_LT((T.inverse() * f.T).log().norm(), 1e-12);
}

}  // namespace
}  // namespace maplet
