// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/shared_keyframe.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace maplet {
namespace {

Se3 ahead(double m) { return {Eigen::Quaterniond::Identity(), Eigen::Vector3d{0.0, 0.0, m}}; }

void see(Maplet& m, int stamp, double at_m) {
  m.keyframes.push_back({Stamp{stamp}, Transform<MapletFrame, CameraFrame>{ahead(at_m)}});
}

TEST(SharedKeyframe, SaysHowTheTwoLie) {
  const auto a = std::make_unique<Maplet>();
  const auto b = std::make_unique<Maplet>();
  a->key = {1, 7, 0};
  b->key = {1, 7, 1};
  see(*a, 10, 0.0);
  see(*a, 20, 2.0);
  see(*b, 30, 0.0);
  EXPECT_FALSE(shared_keyframe(*a, *b));
  see(*b, 20, -0.5);
  const auto T_a_b = shared_keyframe(*a, *b);
  ASSERT_TRUE(T_a_b);
  EXPECT_NEAR((T_a_b->t - Eigen::Vector3d{0.0, 0.0, 2.5}).norm(), 0.0, 1e-12);
  b->key.epoch = 8;  // another life: its clock may be another one
  EXPECT_FALSE(shared_keyframe(*a, *b));
}

}  // namespace
}  // namespace maplet
