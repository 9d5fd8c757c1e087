// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/plane_hold.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace maplet {
namespace {

const Eigen::Vector3d kPitched = Eigen::Vector3d{0.0, -0.9, -0.4}.normalized();

Track at(const Eigen::Vector3d& t) {
  Track track;
  track.state = Track::State::kTracking;
  track.T_keyframe_camera.se3.t = t;
  track.T_odom_camera.se3.t = t;
  track.covariance = 1e-6 * Matrix6d::Identity();
  return track;
}

class PlaneHolds : public testing::Test {
 protected:
  /// Of a wall, or of nothing.
  const std::unique_ptr<PatchSet> empty_ = std::make_unique<PatchSet>();
};

TEST_F(PlaneHolds, WithoutAFloorItIsWhereTheMountingHasIt) {
  PlaneHold hold{Mounting{std::nullopt, kPitched}};
  EXPECT_FALSE(hold.report());
  Track track = at({0.1, 0.2, 0.3});
  hold.hold(track);  // not fixed: left alone
  EXPECT_EQ(track.T_odom_camera.se3.t.y(), 0.2);
  hold.fix(*empty_);
  ASSERT_TRUE(hold.report());
  EXPECT_EQ(hold.report()->from, UpSource::kMounting);
  EXPECT_LT((hold.report()->up - kPitched).norm(), 1e-4);
}

TEST_F(PlaneHolds, AMissionThatGoesOnKeepsItsPlaneUnlessItIsGiven) {
  PlaneHold asked{Mounting{}};
  asked.go_on(kPitched);
  asked.fix(*empty_);
  EXPECT_EQ(asked.report()->from, UpSource::kMission);
  EXPECT_LT((asked.report()->up - kPitched).norm(), 1e-4);
  // What its maplets hold is the plane to the last bit.
  PlaneHold again{Mounting{}};
  again.go_on(asked.report()->up);
  EXPECT_EQ(again.fix(*empty_).code(), PlanarMotion{kPitched}.code());

  PlaneHold given{Mounting{std::array{0.0, -1.0, 0.0}, {0.0, -1.0, 0.0}}};
  given.go_on(kPitched);
  given.fix(*empty_);
  EXPECT_EQ(given.report()->from, UpSource::kGiven);
  EXPECT_EQ(given.report()->up.y(), -1.0);
}

// The other half, a floor that does: tests/replay/planar_test.cpp.
TEST_F(PlaneHolds, WithoutAFloorInViewNothingContradictsAGivenUp) {
  PlaneHold blind{Mounting{std::array{0.0, -1.0, 0.0}, {0.0, -1.0, 0.0}}};
  blind.fix(*empty_);
  EXPECT_EQ(blind.report()->floor_off_rad, 0.0);
}

TEST_F(PlaneHolds, CountsWhatIsSeenOffThePlaneAndBringsItIn) {
  PlaneHold hold{Mounting{}};
  const Eigen::Vector3d up = hold.fix(*empty_).up();
  Track level = at({0.3, 0.0, 0.4});
  hold.hold(level);
  EXPECT_EQ(hold.report()->off, 0U);
  Track climbed = at({0.3, -0.05, 0.4});
  hold.hold(climbed);
  EXPECT_EQ(hold.report()->off, 1U);
  EXPECT_EQ(hold.report()->of, 2U);
  EXPECT_NEAR(up.dot(climbed.T_odom_camera.se3.t), 0.0, 1e-12);
  EXPECT_NEAR(climbed.T_odom_camera.se3.t.x(), 0.3, 1e-6);
  EXPECT_GT(climbed.covariance(0, 0), 10.0 * level.covariance(0, 0));  // it is not to be trusted
}

}  // namespace
}  // namespace maplet
