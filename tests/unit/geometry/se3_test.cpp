// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/geometry/se3.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>
#include <type_traits>

#include "core/geometry/plane.hpp"

namespace maplet {
namespace {

Vector6d random_tangent(std::mt19937& rng, double angle_limit) {
  std::uniform_real_distribution<double> unit{-1.0, 1.0};
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi[i] = unit(rng);
  xi.tail<3>() *= angle_limit / 1.8;
  return xi;
}

TEST(Se3, ExpAndLogAreInverse) {
  std::mt19937 rng{1};
  for (const double angle : {1e-9, 1e-6, 1e-3, 0.5, 3.0}) {
    for (int i = 0; i < 50; ++i) {
      const Vector6d xi = random_tangent(rng, angle);
      EXPECT_LT((Se3::exp(xi).log() - xi).norm(), 1e-9) << xi.transpose();
    }
  }
}

TEST(Se3, LogSurvivesHalfTurn) {
  Vector6d xi = Vector6d::Zero();
  xi.tail<3>() = Eigen::Vector3d{0.0, std::numbers::pi, 0.0};
  EXPECT_NEAR(Se3::exp(xi).log().tail<3>().norm(), std::numbers::pi, 1e-9);
}

TEST(Se3, InverseAndCompositionAgree) {
  std::mt19937 rng{2};
  for (int i = 0; i < 100; ++i) {
    const Se3 a = Se3::exp(random_tangent(rng, 3.0));
    EXPECT_LT((a * a.inverse()).log().norm(), 1e-12);
  }
}

TEST(Se3, AdjointMovesTangents) {
  std::mt19937 rng{3};
  for (int i = 0; i < 100; ++i) {
    const Se3 a = Se3::exp(random_tangent(rng, 3.0));
    const Vector6d xi = random_tangent(rng, 1.0);
    const Se3 left = a * Se3::exp(xi) * a.inverse();
    EXPECT_LT((left.inverse() * Se3::exp(a.adjoint() * xi)).log().norm(), 1e-9);
  }
}

TEST(Se3, RightJacobianInverseMatchesNumericOne) {
  std::mt19937 rng{4};
  for (const double angle : {1e-7, 1e-3, 0.5, 2.5}) {
    for (int i = 0; i < 20; ++i) {
      const Vector6d xi = random_tangent(rng, angle);
      const Matrix6d jacobian = right_jacobian_inverse(xi);
      for (int k = 0; k < 6; ++k) {
        Vector6d step = Vector6d::Zero();
        step[k] = 1e-6;
        const Vector6d up = (Se3::exp(xi) * Se3::exp(step)).log();
        const Vector6d down = (Se3::exp(xi) * Se3::exp(-step)).log();
        EXPECT_LT(((up - down) / 2e-6 - jacobian.col(k)).norm(), 1e-6);
      }
    }
  }
}

TEST(Plane, MovesWithItsPoints) {
  std::mt19937 rng{5};
  const Plane b{Eigen::Vector3d{1.0, 2.0, -3.0}.normalized(), 0.7};
  const Eigen::Vector3d p = -b.d * b.n;  // on the plane
  for (int i = 0; i < 20; ++i) {
    const Se3 T_a_b = Se3::exp(random_tangent(rng, 3.0));
    EXPECT_NEAR((T_a_b * b).distance(T_a_b * p), 0.0, 1e-12);
  }
}

TEST(Plane, ThetaRoundTrip) {
  const Plane plane{Eigen::Vector3d{0.1, -0.2, -0.9}.normalized(), 2.5};
  const Plane back = Plane::from_theta(plane.theta());
  EXPECT_LT((back.n - plane.n).norm(), 1e-12);
  EXPECT_NEAR(back.d, plane.d, 1e-12);
}

template <class A, class B>
concept Composes = requires(A a, B b) {
  a* b;
};
static_assert(Composes<Transform<WorldFrame, BodyFrame>, Transform<BodyFrame, CameraFrame>>);
static_assert(!Composes<Transform<WorldFrame, BodyFrame>, Transform<WorldFrame, BodyFrame>>);

}  // namespace
}  // namespace maplet
