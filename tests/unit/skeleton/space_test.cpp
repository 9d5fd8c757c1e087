// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/space.hpp"

#include <gtest/gtest.h>

#include <random>

namespace maplet {
namespace {

template <class Space>
class SpaceTest : public testing::Test {
 protected:
  using Tangent = typename Space::Tangent;
  using Block = typename Space::Block;
  using Pose = typename Space::Pose;

  Tangent random_tangent(double scale) {
    Tangent xi;
    for (int i = 0; i < Space::kDim; ++i) xi[i] = scale * normal_(random_);
    return xi;
  }
  Pose random_pose(double scale) { return Space::retract(Pose{}, random_tangent(scale)); }

  std::mt19937 random_{7};
  std::normal_distribution<double> normal_;
};

using Spaces = testing::Types<PlanarSpace, SpatialSpace>;
TYPED_TEST_SUITE(SpaceTest, Spaces);

TYPED_TEST(SpaceTest, JacobiansMatchNumericOnes) {
  using Space = TypeParam;
  constexpr double kStep = 1e-6;
  for (int trial = 0; trial < 20; ++trial) {
    const auto a = this->random_pose(2.0);
    const auto b = this->random_pose(2.0);
    const auto rel = Space::between(a, b);
    const auto z = Space::retract(rel, this->random_tangent(0.3));
    const auto e = Space::error(z, rel);
    typename Space::Block by_a, by_b;
    Space::jacobians(z, rel, e, by_a, by_b);
    for (int i = 0; i < Space::kDim; ++i) {
      typename Space::Tangent d = Space::Tangent::Zero();
      d[i] = kStep;
      const auto a_plus = Space::between(Space::retract(a, d), b);
      const auto a_minus = Space::between(Space::retract(a, -d), b);
      const auto b_plus = Space::between(a, Space::retract(b, d));
      const auto b_minus = Space::between(a, Space::retract(b, -d));
      EXPECT_LT(
          ((Space::error(z, a_plus) - Space::error(z, a_minus)) / (2 * kStep) - by_a.col(i)).norm(),
          1e-7);
      EXPECT_LT(
          ((Space::error(z, b_plus) - Space::error(z, b_minus)) / (2 * kStep) - by_b.col(i)).norm(),
          1e-7);
    }
  }
}

TYPED_TEST(SpaceTest, PullBackAndPushForwardAreTheJacobians) {
  using Space = TypeParam;
  for (int trial = 0; trial < 20; ++trial) {
    const auto z = this->random_pose(1.0);
    const auto rel = Space::retract(z, this->random_tangent(trial < 10 ? 0.5 : 1e-3));
    const auto e = Space::error(z, rel);
    const auto v = this->random_tangent(3.0);
    typename Space::Block by_a, by_b;
    Space::jacobians(z, rel, e, by_a, by_b);
    typename Space::Tangent grad_a, grad_b;
    Space::pull_back(z, rel, e, v, grad_a, grad_b);
    EXPECT_LT((grad_a - by_a.transpose() * v).norm(), 1e-9);
    EXPECT_LT((grad_b - by_b.transpose() * v).norm(), 1e-9);
    const auto xi_a = this->random_tangent(1.0);
    const auto xi_b = this->random_tangent(1.0);
    EXPECT_LT((Space::push_forward(z, rel, e, xi_a, xi_b) - by_a * xi_a - by_b * xi_b).norm(),
              1e-9);
  }
}

TYPED_TEST(SpaceTest, StalenessIgnoresRigidMotionAndSeesChange) {
  using Space = TypeParam;
  const auto a = this->random_pose(1.0);
  const auto b = this->random_pose(1.0);
  const auto world = this->random_pose(5.0);
  const auto rel = Space::between(a, b);
  const auto moved = Space::between(Space::compose(world, a), Space::compose(world, b));
  EXPECT_LT(Space::staleness(moved, rel), 1e-9);
  typename Space::Tangent turn = Space::Tangent::Zero();
  turn[Space::kDim - 1] = 0.1;
  EXPECT_NEAR(Space::staleness(Space::retract(rel, turn), rel), 0.1, 1e-3);
}

}  // namespace
}  // namespace maplet
