// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/map_frame.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace maplet {
namespace {

MapletKey key(std::uint16_t agent, std::uint32_t id) { return {agent, 7, id}; }

DeltaPose link(const MapletKey& a, const MapletKey& b, double x_m) {
  DeltaPose d;
  d.kind = DeltaPose::Kind::kConsecutive;
  d.a = a;
  d.b = b;
  d.T_a_b.se3.t.x() = x_m;
  d.covariance = 1e-4 * Matrix6d::Identity();
  return d;
}

Se3 along_x(double x_m) { return {Eigen::Quaterniond::Identity(), {x_m, 0.0, 0.0}}; }

struct MapFrameTest : testing::Test {
  Arena arena{std::size_t{1} << 26};
  Skeleton skeleton{{.max_nodes = 32, .max_factors = 64}, arena};
  MapFrame frame;
};

TEST_F(MapFrameTest, IsTheIdentityBeforeTheFirstMaplet) {
  frame.update(skeleton, along_x(3.0));
  EXPECT_EQ(frame.notice().T_map_odom.t.norm(), 0.0);
  frame.hang_from(key(1, 0), Se3{});  // one that the skeleton has not heard of
  frame.update(skeleton, along_x(3.0));
  EXPECT_EQ(frame.notice().jumps, 0U);
}

TEST_F(MapFrameTest, TakesUpWhatTheSkeletonSaysOfTheNewestMaplet) {
  skeleton.add(link(key(1, 0), key(1, 1), 2.0), Deadline::never());
  frame.hang_from(key(1, 1), along_x(2.02));  // odometry had gone 2 cm further
  frame.update(skeleton, along_x(2.5));
  EXPECT_NEAR(frame.notice().T_map_odom.t.x(), -0.02, 1e-9);
  EXPECT_EQ(frame.notice().map, key(1, 0));
  EXPECT_EQ(frame.notice().jumps, 0U);
}

TEST_F(MapFrameTest, CountsJumpsAndChangesToAnotherMap) {
  skeleton.add(link(key(2, 0), key(2, 1), 1.0), Deadline::never());
  frame.hang_from(key(2, 1), along_x(1.0));
  frame.update(skeleton, along_x(1.0));
  // The senior agent's map takes over: its world is another one.
  skeleton.add(link(key(1, 0), key(1, 1), 1.0), Deadline::never());
  skeleton.add(link(key(1, 1), key(2, 0), 5.0), Deadline::never());
  frame.update(skeleton, along_x(1.0));
  EXPECT_EQ(frame.notice().map, key(1, 0));
  EXPECT_EQ(frame.notice().other_map, 1U);
  EXPECT_EQ(frame.notice().jumps, 1U);
  EXPECT_NEAR(frame.notice().T_map_odom.t.x(), 6.0, 1e-6);
}

}  // namespace
}  // namespace maplet
