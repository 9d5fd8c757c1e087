// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/tracker.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/support/track_session.hpp"

namespace maplet {
namespace {

using test::PatchScene;
using Session = test::TrackSession;

Se3 pose_at(double s) { return test::wandering(s); }

TEST(Tracker, FollowsASmoothMotion) {
  const PatchScene scene = test::room();
  Session session;
  const Se3 start = pose_at(0.0);
  for (int i = 0; i < 150; ++i) {
    const Se3 truth = start.inverse() * pose_at(0.033 * i);
    const Track track = session.step(scene, pose_at(0.033 * i));
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    const Se3 error = truth.inverse() * track.T_odom_camera.se3;
    ASSERT_LT(error.t.norm(), 0.01) << i;
    ASSERT_LT(error.angle(), 0.005) << i;
  }
  EXPECT_GT(session.keyframes, 2);
  EXPECT_EQ(session.tracker->counters().lost, 0u);
}

TEST(Tracker, RecoversAnExactMotionExactly) {
  PatchScene scene = test::room();
  scene.noise = 0.0;
  Session session;
  session.step(scene, pose_at(0.0));
  const Track track = session.step(scene, pose_at(0.05));
  ASSERT_EQ(track.state, Track::State::kTracking);
  const Se3 truth = pose_at(0.0).inverse() * pose_at(0.05);
  EXPECT_LT((truth.inverse() * track.T_odom_camera.se3).log().norm(), 5e-4);
  EXPECT_TRUE(track.free_axes.empty());
}

// The span of the free axes holds the expected ones and nothing else.
void expect_free(const Track& track, const std::vector<Vector6d>& expected) {
  ASSERT_EQ(track.free_axes.size(), expected.size());
  for (const Vector6d& axis : expected) {
    Vector6d rest = axis.normalized();
    for (const Vector6d& free : track.free_axes) rest -= free * free.dot(axis.normalized());
    EXPECT_LT(rest.norm(), 0.1) << axis.transpose();
  }
}

TEST(Tracker, NamesTheCorridorsAxisAndKeepsTheSpeedAlongIt) {
  const PatchScene scene = test::corridor();
  Session session;
  Track track;
  for (int i = 0; i < 60; ++i) {
    Vector6d xi = Vector6d::Zero();
    xi[0] = 0.05 * std::sin(0.1 * i);
    xi[2] = 0.02 * i;
    track = session.step(scene, Se3::exp(xi));
    ASSERT_EQ(track.state, Track::State::kTracking);
    if (i == 0) continue;
    expect_free(track, {Vector6d::Unit(2)});
  }
  // What is across is tight; along, nothing was seen: still at the start, and it says so.
  EXPECT_NEAR(track.T_odom_camera.se3.t.x(), 0.05 * std::sin(5.9), 0.01);
  EXPECT_NEAR(track.T_odom_camera.se3.t.z(), 0.0, 0.02);
  EXPECT_LT(std::sqrt(track.covariance(0, 0)), 0.01);
  EXPECT_LT(std::sqrt(track.covariance(1, 1)), 0.01);
}

TEST(Tracker, AlongACorridorTheUncertaintyCoversTheWayMade) {
  OdometryConfig config;
  config.keyframe_entropy = 10.0;
  Session session{config};
  const PatchScene scene = test::corridor();
  double last = 0.0;
  for (int i = 0; i < 10; ++i) {
    const Track track = session.step(scene, Se3::exp(0.015 * i * Vector6d::Unit(2)));
    if (i == 0 || track.keyframe_due) continue;
    const double sigma = std::sqrt(track.covariance(2, 2));
    EXPECT_GT(sigma, last);
    EXPECT_LT(std::abs(0.015 * i - track.T_odom_camera.se3.t.z()), 3.0 * sigma);
    last = sigma;
  }
  EXPECT_GT(last, 0.03);
}

TEST(Tracker, NamesTheFreeAxesOfOneWall) {
  PatchScene scene;
  scene.rectangles = {{{0, 0, 2}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 9, 9}};
  Session session;
  session.step(scene, Se3{});
  const Track track = session.step(scene, Se3::exp(0.01 * Vector6d::Unit(2)));
  ASSERT_EQ(track.state, Track::State::kTracking);
  expect_free(track, {Vector6d::Unit(0), Vector6d::Unit(1), Vector6d::Unit(5)});
  EXPECT_NEAR(track.T_odom_camera.se3.t.z(), 0.01, 0.003);
}

TEST(Tracker, NamesTheFreeAxisOfTwoWalls) {
  PatchScene scene;
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d a = Eigen::Vector3d{1.0, 0.0, 0.7}.normalized();
  const Eigen::Vector3d b = Eigen::Vector3d{1.0, 0.0, -0.7}.normalized();
  scene.rectangles = {{Eigen::Vector3d{0, 0, 3} - 2.0 * a, y, a, 9, 2},
                      {Eigen::Vector3d{0, 0, 3} + 2.0 * b, y, b, 9, 2}};
  Session session;
  session.step(scene, Se3{});
  const Track track = session.step(scene, Se3::exp(0.01 * Vector6d::Unit(0)));
  ASSERT_EQ(track.state, Track::State::kTracking);
  expect_free(track, {Vector6d::Unit(1)});
  EXPECT_NEAR(track.T_odom_camera.se3.t.x(), 0.01, 0.003);
}

TEST(Tracker, GivesAUsablePoseWhenTheDeadlineIsOver) {
  const PatchScene scene = test::room();
  Session session;
  const ManualClock clock;
  session.step(scene, pose_at(0.0));
  for (int i = 1; i < 20; ++i) {
    const Track track = session.step(scene, pose_at(0.033 * i), Deadline{clock, Duration{0}});
    ASSERT_EQ(track.state, Track::State::kTracking);
    EXPECT_EQ(track.stop, Stop::kDeadline);
    EXPECT_EQ(track.iterations, 1u);
    const Se3 truth = pose_at(0.0).inverse() * pose_at(0.033 * i);
    EXPECT_LT((truth.inverse() * track.T_odom_camera.se3).t.norm(), 0.03);
  }
}

TEST(Tracker, IsNotPulledByAMovingPerson) {
  PatchScene scene = test::room();
  const std::size_t walls = scene.rectangles.size();
  Session session;
  for (int i = 0; i < 120; ++i) {
    scene.rectangles.resize(walls);
    // At 0.6 m/s from the left to the right; 30 % of the image while in its middle.
    const double x = -1.2 + 0.02 * i;
    scene.rectangles.push_back({pose_at(0.033 * i) * Eigen::Vector3d{x, 0.0, 1.2},
                                Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 0.34, 0.34});
    const Track track = session.step(scene, pose_at(0.033 * i));
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    const Se3 truth = pose_at(0.0).inverse() * pose_at(0.033 * i);
    ASSERT_LT((truth.inverse() * track.T_odom_camera.se3).t.norm(), 0.09) << i;
  }
}

TEST(Tracker, StandsStillOnADuplicatedFrame) {
  const PatchScene scene = test::room();
  Session session;
  for (int i = 0; i < 10; ++i) session.step(scene, pose_at(0.033 * i));
  const Track before = session.step(scene, pose_at(0.33));
  --session.index;
  const Track again = session.feed();
  ASSERT_EQ(again.state, Track::State::kTracking);
  const Se3 moved = before.T_odom_camera.se3.inverse() * again.T_odom_camera.se3;
  EXPECT_LT(moved.t.norm(), 1e-3);
  EXPECT_EQ(session.tracker->counters().not_forward, 1u);
}

TEST(Tracker, IsLostInTheDarkAndFindsTheViewAgain) {
  const PatchScene scene = test::room();
  Session session;
  for (int i = 0; i < 20; ++i) session.step(scene, pose_at(0.033 * i));
  for (int i = 20; i < 28; ++i) {
    session.patches->patches.clear();
    EXPECT_EQ(session.feed().state, Track::State::kLost);
  }
  const Track track = session.step(scene, pose_at(0.033 * 28));
  ASSERT_EQ(track.state, Track::State::kTracking);
  const Se3 truth = pose_at(0.0).inverse() * pose_at(0.033 * 28);
  EXPECT_LT((truth.inverse() * track.T_odom_camera.se3).t.norm(), 0.02);
  EXPECT_EQ(session.tracker->counters().lost, 8u);
  EXPECT_EQ(session.tracker->counters().recovered, 1u);
  EXPECT_EQ(session.tracker->counters().segments, 0u);
}

TEST(Tracker, OpensANewSegmentWithAnHonestGapInAnotherRoom) {
  const PatchScene scene = test::room();
  PatchScene other;
  other.add_box({-5.0, -2.4, -4.0}, {0.9, 1.0, 1.9});
  other.add_box({-0.5, 0.0, 1.0}, {0.3, 1.0, 1.3});
  OdometryConfig config;
  Session session{config};
  for (int i = 0; i < 20; ++i) session.step(scene, pose_at(0.033 * i));
  for (int i = 0; i < 60; ++i) {
    session.patches->patches.clear();
    session.feed();
  }
  Track track;
  int frames = 0;
  do {
    track = session.step(other, Se3{});
  } while (track.state == Track::State::kLost && ++frames < 20);
  EXPECT_EQ(frames, config.lost_frames - 1);
  ASSERT_TRUE(track.keyframe_due);
  EXPECT_EQ(session.last_keyframe->segment, 1u);
  for (int k = 0; k < 3; ++k) EXPECT_GT(session.last_keyframe->covariance(k, k), 0.3 * 0.3);
  EXPECT_EQ(session.step(other, Se3{}).state, Track::State::kTracking);
}

TEST(Tracker, StartsLostWithoutAnythingToSee) {
  Session session;
  for (int i = 0; i < 3; ++i) EXPECT_EQ(session.feed().state, Track::State::kLost);
  const Track track = session.step(test::room(), Se3{});
  EXPECT_EQ(track.state, Track::State::kTracking);
  EXPECT_TRUE(track.keyframe_due);
  EXPECT_EQ(session.last_keyframe->id, 0u);
}

}  // namespace
}  // namespace maplet
