// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// External odometry and gyro as motion priors: right, wrong, stale.
#include <gtest/gtest.h>

#include "tests/support/track_session.hpp"

namespace maplet {
namespace {

using test::PatchScene;
using test::TrackSession;
using test::wandering;

MotionHint pose_hint(const Se3& T) {
  MotionHint hint;
  hint.has_pose = true;
  hint.T_external_camera = T;
  return hint;
}

// A camera carried down a corridor: nothing along z is seen.
Track along_the_corridor(TrackSession& session, bool with_hint) {
  const PatchScene scene = test::corridor();
  Track track;
  for (int i = 0; i < 60; ++i) {
    const Se3 truth = Se3::exp(0.02 * i * Vector6d::Unit(2));
    // In a frame of its own, 2 % too long.
    const Se3 external = Se3::exp(0.3 * Vector6d::Unit(4)) * Se3{truth.q, 1.02 * truth.t};
    session.frame.motion = with_hint ? pose_hint(external) : MotionHint{};
    track = session.step(scene, truth);
    EXPECT_EQ(track.state, Track::State::kTracking) << i;
  }
  return track;
}

TEST(Hints, FillTheAxisThatNothingIsSeenAlong) {
  TrackSession session;
  const Track track = along_the_corridor(session, true);
  EXPECT_NEAR(track.T_odom_camera.se3.t.z(), 1.18, 0.08);
  ASSERT_EQ(track.free_axes.size(), 1u) << "a hint is not a sight: the axis stays named";
  EXPECT_GT(std::abs(track.free_axes[0][2]), 0.99);
  EXPECT_GT(session.tracker->counters().hints_used, 50u);
  TrackSession blind;
  const Track without = along_the_corridor(blind, false);
  EXPECT_LT(without.T_odom_camera.se3.t.z(), 0.1);
}

// Nothing along z is seen, but what the odometry says is aside of the corridor, that is.
TEST(Hints, OffByThirtyDegreesTheyFillNoFreeAxis) {
  const PatchScene scene = test::corridor();
  TrackSession session;
  const Se3 turned = Se3::exp(0.52 * Vector6d::Unit(4));
  Track track;
  for (int i = 0; i < 90; ++i) {
    const Se3 truth = Se3::exp(0.02 * i * Vector6d::Unit(2));
    session.frame.motion = pose_hint(Se3{truth.q, turned.q * truth.t});
    track = session.step(scene, truth);
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
  }
  EXPECT_GT(session.tracker->counters().hints_refused, 50u);
  const double sigma = std::sqrt(track.covariance(2, 2));
  EXPECT_GT(sigma, 0.05) << "since the keyframe nobody knows";
}

TEST(Hints, AWheelTooLargeStaysTooLarge) {
  const PatchScene scene = test::corridor();
  TrackSession session;
  double variance = 0.0;
  Track track;
  for (int i = 0; i < 400; ++i) {
    const Se3 truth = Se3::exp(0.02 * i * Vector6d::Unit(2));
    session.frame.motion = pose_hint(Se3{truth.q, 1.05 * truth.t});
    track = session.step(scene, truth);
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    if (track.keyframe_due) variance += session.last_keyframe->covariance(2, 2);
  }
  const double error = track.T_odom_camera.se3.t.z() - 0.02 * 399;
  EXPECT_GT(error, 0.3);
  EXPECT_LT(error, 2.0 * std::sqrt(variance + track.covariance(2, 2)));
  EXPECT_LT(std::sqrt(variance), 1.0);
}

TEST(Hints, OffByThirtyDegreesTheyAreRefusedAndTrackingGoesOn) {
  const PatchScene scene = test::room();
  TrackSession session;
  Se3 wrong;
  for (int i = 0; i < 90; ++i) {
    const Se3 truth = wandering(0.033 * i);
    if (i % 10 == 5) wrong = wrong * Se3::exp(0.52 * Vector6d::Unit(4));
    session.frame.motion = pose_hint(wandering(0.0).inverse() * truth * wrong);
    const Track track = session.step(scene, truth);
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    const Se3 error = (wandering(0.0).inverse() * truth).inverse() * track.T_odom_camera.se3;
    ASSERT_LT(error.t.norm(), 0.01) << i;
  }
  EXPECT_GE(session.tracker->counters().hints_refused, 9u);
  EXPECT_EQ(session.tracker->counters().lost, 0u);
}

TEST(Hints, StaleOnesAreDoubtedAfterAWhile) {
  const PatchScene scene = test::room();
  TrackSession session;
  for (int i = 0; i < 90; ++i) {
    const Se3 truth = wandering(0.033 * i);
    session.frame.motion = pose_hint(i < 20 ? truth : wandering(0.033 * 20));  // froze
    const Track track = session.step(scene, truth);
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    const Se3 error = (wandering(0.0).inverse() * truth).inverse() * track.T_odom_camera.se3;
    ASSERT_LT(error.t.norm(), 0.01) << i;
  }
  EXPECT_GT(session.tracker->counters().hints_refused, 0u);
}

// Down a corridor the odometry ends in the middle of the way: it says what it said last.
TEST(Hints, FrozenAlongAFreeAxisTheyClaimLittle) {
  const PatchScene scene = test::corridor();
  TrackSession session;
  double variance = 0.0;
  Track track;
  for (int i = 0; i < 60; ++i) {
    const Se3 truth = Se3::exp(0.02 * i * Vector6d::Unit(2));
    session.frame.motion = pose_hint(i < 30 ? truth : Se3::exp(0.6 * Vector6d::Unit(2)));
    track = session.step(scene, truth);
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    if (track.keyframe_due) variance += session.last_keyframe->covariance(2, 2);
  }
  const double error = 0.02 * 59 - track.T_odom_camera.se3.t.z();
  EXPECT_LT(error, 2.5 * std::sqrt(variance + track.covariance(2, 2)));
}

// A source that stands still slowly is believed; one that breaks off in full motion while nothing
// is seen, or leaps, is not.
TEST(Hints, InTheDarkOnlyWhoGoesOnMeasuringIsBelieved) {
  const PatchScene scene = test::room();
  enum class Source { kGoesOn, kFreezes, kLeaps };
  for (const auto source : {Source::kGoesOn, Source::kFreezes, Source::kLeaps}) {
    TrackSession session;
    Track track;
    for (int i = 0; i < 40; ++i) {
      const Se3 truth = wandering(0.033 * i);
      const bool dark = i >= 20 && i < 39;
      Se3 said = source == Source::kFreezes && i >= 20 ? wandering(0.033 * 19) : truth;
      if (source == Source::kLeaps && i >= 25) said = said * Se3::exp(0.6 * Vector6d::Unit(4));
      session.frame.motion = pose_hint(said);
      const std::uint64_t used = session.tracker->counters().hints_used;
      track = session.step(dark ? PatchScene{} : scene, truth);
      if (i < 39) continue;
      EXPECT_EQ(session.tracker->counters().hints_used - used, source == Source::kGoesOn ? 1u : 0u)
          << static_cast<int>(source);
    }
  }
}

TEST(Hints, TwiceAsLongAsTheWayTheyAreDoubted) {
  const PatchScene scene = test::room();
  TrackSession session;
  Se3 external;
  Se3 last = wandering(0.0);
  for (int i = 0; i < 150; ++i) {
    const Se3 truth = wandering(0.02 * i);
    Se3 step = last.inverse() * truth;
    step.t *= 2.0;  // up to a centimetre too much a frame
    external = external * step;
    last = truth;
    session.frame.motion = pose_hint(external);
    const Track track = session.step(scene, truth);
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    const Se3 error = (wandering(0.0).inverse() * truth).inverse() * track.T_odom_camera.se3;
    ASSERT_LT(error.t.norm(), 0.012) << i;
  }
  EXPECT_GT(session.tracker->counters().hints_refused, 50u);
}

TEST(Hints, AGyroCarriesOverATurnThatNobodyExpected) {
  const PatchScene scene = test::room();
  TrackSession session;
  for (int i = 0; i < 12; ++i) {
    const Se3 truth = Se3::exp((i < 6 ? 0.0 : 0.3) * Vector6d::Unit(4));  // 17 deg at once
    session.frame.motion = {};
    session.frame.motion.has_turn = true;
    session.frame.motion.q_gyro_camera = truth.q;
    const Track track = session.step(scene, truth);
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    ASSERT_LT((truth.inverse() * track.T_odom_camera.se3).log().norm(), 0.02) << i;
  }
  EXPECT_GE(session.tracker->counters().hints_used, 5u);
  EXPECT_EQ(session.tracker->counters().hints_refused, 0u);
}

// Nothing is seen along the corridor: a gyro says nothing of it either.
TEST(Hints, AGyroMakesNoVelocityAlongAFreeAxis) {
  const PatchScene scene = test::corridor();
  TrackSession session;
  Track track;
  for (int i = 0; i < 200; ++i) {
    const Se3 truth{wandering(0.033 * i).q, Eigen::Vector3d::Zero()};
    session.frame.motion.has_turn = true;
    session.frame.motion.q_gyro_camera = truth.q;
    track = session.step(scene, truth);
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
  }
  EXPECT_EQ(session.tracker->counters().lost, 0u);
  EXPECT_LT(track.T_odom_camera.se3.t.norm(), 0.3);
}

// While nothing is seen nobody checks what is said: known to half of what differs from going on.
TEST(Hints, InTheDarkNobodyChecksWhatIsSaid) {
  const Vector6d velocity = 0.3 * Vector6d::Unit(0);
  const auto sigma_m = [&](double said_m) {
    HintFollower follower{OdometryConfig{}};
    follower.keep(pose_hint({}), velocity);
    constexpr int kFrames = 30;
    constexpr double kStepS = 1.0 / kFrames;
    for (int i = 1; i <= kFrames; ++i) {
      follower.watch(pose_hint(Se3::exp(said_m * i / kFrames * Vector6d::Unit(0))), kStepS);
    }
    HintedMotion motion;
    EXPECT_TRUE(follower.motion(HintFollower::kPose,
                                pose_hint(Se3::exp(said_m * Vector6d::Unit(0))), motion));
    return 1.0 / std::sqrt(motion.information(0, 0));
  };
  EXPECT_LT(sigma_m(0.3), 0.03) << "going on as before";
  EXPECT_NEAR(sigma_m(-0.3), 0.3, 0.03) << "turned round";
  EXPECT_NEAR(sigma_m(0.9), 0.3, 0.03) << "slips";
}

TEST(Hints, WhatIsNotANumberIsNoHint) {
  const PatchScene scene = test::room();
  TrackSession session;
  for (int i = 0; i < 10; ++i) {
    const Se3 truth = wandering(0.033 * i);
    session.frame.motion = pose_hint(truth);
    if (i == 5) session.frame.motion.T_external_camera.t.x() = std::nan("");
    const Track track = session.step(scene, truth);
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    ASSERT_TRUE(track.T_odom_camera.se3.t.allFinite());
  }
}

}  // namespace
}  // namespace maplet
