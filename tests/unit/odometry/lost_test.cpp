// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Losing the view, saying why, and finding it: in keyframes, in stored views, after a gap.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <vector>

#include "tests/support/track_session.hpp"

namespace maplet {
namespace {

using test::PatchScene;
using test::TrackSession;
using test::wandering;

// Views drawn from a scene, as agent/ draws them from maplets.
class SceneViews final : public ViewSource {
 public:
  SceneViews(const PatchScene& scene, std::vector<Se3> T_world_view)
      : scene_{scene}, T_world_view_{std::move(T_world_view)} {
    scene_.noise = 0.0;
  }
  [[nodiscard]] std::size_t count() const noexcept override { return T_world_view_.size(); }
  [[nodiscard]] StoredView at(std::size_t index) const noexcept override {
    return {T_world_view_[index], 0};
  }
  [[nodiscard]] bool draw(std::size_t index, const CameraModel&, PatchSet& out) noexcept override {
    ++drawn;
    out = scene_.view(T_world_view_[index], rng_);
    return true;
  }
  int drawn = 0;

 private:
  PatchScene scene_;
  std::vector<Se3> T_world_view_;
  std::mt19937 rng_{3};
};

Se3 turned(double rad) { return Se3::exp(rad * Vector6d::Unit(4)); }

// Looks ahead, turns round and wanders at the other end until no keyframe of the first view is
// left.
void leave_the_first_view(TrackSession& session, const PatchScene& scene) {
  for (int i = 0; i < 20; ++i) session.step(scene, Se3{});
  for (int i = 0; i < 60; ++i) session.step(scene, turned(M_PI / 60.0 * i));
  const int before = session.keyframes;
  for (int i = 0; i < 600 && session.keyframes < before + 14; ++i) {
    const Track track =
        session.step(scene, turned(M_PI) * wandering(0.0).inverse() * wandering(0.033 * i));
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
  }
  ASSERT_GE(session.keyframes, before + 14);
}

void darken(TrackSession& session, int frames) {
  for (int i = 0; i < frames; ++i) {
    session.patches->clear();
    const Track track = session.feed();
    EXPECT_EQ(track.state, Track::State::kLost);
    EXPECT_EQ(track.loss, Loss::kNoDepth);
  }
}

Se3 near_the_first_view() {
  Vector6d xi;
  xi << 0.06, -0.03, 0.04, 0.03, -0.04, 0.02;
  return Se3::exp(xi);
}

TEST(Lost, AViewThatOnlyStoredPlanesHoldIsFoundAgain) {
  const PatchScene scene = test::room();
  SceneViews views{scene, {turned(0.5 * M_PI), Se3{}}};
  TrackSession session;
  session.tracker->look_through(views);
  leave_the_first_view(session, scene);
  EXPECT_EQ(views.drawn, 0) << "nothing is drawn while the camera is tracked";
  darken(session, 40);
  Track track;
  int frames = 0;
  do {
    // It moves: what looks alike from one place does not from another.
    track = session.step(
        scene, near_the_first_view() * Se3::exp(0.01 * std::min(frames, 25) * Vector6d::Unit(0)));
  } while (session.tracker->counters().in_stored_views == 0 && ++frames < 60);
  ASSERT_EQ(track.state, Track::State::kTracking);
  EXPECT_TRUE(track.keyframe_due) << "no keyframe sees this";
  const auto& counters = session.tracker->counters();
  EXPECT_EQ(counters.in_stored_views, 1u);
  EXPECT_EQ(counters.recovered + counters.tied, 1u);
  const Se3 there =
      near_the_first_view() * Se3::exp(0.01 * std::min(frames, 25) * Vector6d::Unit(0));
  const Se3 error = there.inverse() * track.T_odom_camera.se3;
  EXPECT_LT(error.t.norm(), 0.02);
  EXPECT_LT(error.angle(), 0.02);
  // And the track goes on from there.
  for (int i = 0; i < 30; ++i) {
    const Se3 truth = there * Se3::exp(0.003 * i * Vector6d::Unit(0));
    track = session.step(scene, truth);
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    ASSERT_LT((truth.inverse() * track.T_odom_camera.se3).t.norm(), 0.03) << i;
  }
}

TEST(Lost, WithoutStoredViewsANewSegmentBegins) {
  const PatchScene scene = test::room();
  TrackSession session;
  leave_the_first_view(session, scene);
  darken(session, 40);
  Track track;
  for (int i = 0; i < 10; ++i) track = session.step(scene, near_the_first_view());
  EXPECT_EQ(session.tracker->counters().in_stored_views, 0u);
  EXPECT_EQ(session.tracker->counters().segments, 1u);
  EXPECT_EQ(track.state, Track::State::kTracking);
}

TEST(Lost, AStoredViewOfAnotherPlaceIsNotTakenForThisOne) {
  PatchScene other;
  other.add_box({-2.4, -1.4, -2.0}, {2.9, 1.0, 2.2});
  other.add_box({-0.2, 0.1, 1.2}, {0.9, 1.0, 2.2});
  SceneViews views{other, {Se3{}, turned(0.4), turned(-0.4)}};
  const PatchScene scene = test::room();
  TrackSession session;
  session.tracker->look_through(views);
  leave_the_first_view(session, scene);
  darken(session, 40);
  for (int i = 0; i < 20; ++i) session.step(scene, near_the_first_view());
  EXPECT_GT(views.drawn, 0);
  EXPECT_EQ(session.tracker->counters().in_stored_views, 0u);
}

TEST(Lost, AnEarlierSegmentIsRecognisedWhenItsViewReturns) {
  const PatchScene scene = test::room();
  PatchScene other;
  other.add_box({-5.0, -2.4, -4.0}, {0.9, 1.0, 1.9});
  other.add_box({-0.5, 0.0, 1.0}, {0.3, 1.0, 1.3});
  TrackSession session;
  for (int i = 0; i < 20; ++i) session.step(scene, wandering(0.033 * i));
  darken(session, 30);
  for (int i = 0; i < 20; ++i) session.step(other, Se3::exp(0.005 * i * Vector6d::Unit(0)));
  ASSERT_EQ(session.last_keyframe->segment, 1u);
  Track track;
  bool crossed = false;
  for (int i = 0; i < 60; ++i) {
    const Se3 truth = wandering(0.0).inverse() * wandering(0.6 - 0.01 * i);
    track = session.step(scene, wandering(0.6 - 0.01 * i));
    if (track.state != Track::State::kTracking) continue;
    crossed = crossed || session.last_keyframe->segment == 0;
    if (!crossed) continue;
    EXPECT_LT((truth.inverse() * track.T_odom_camera.se3).t.norm(), 0.02) << i;
  }
  EXPECT_TRUE(crossed);
  EXPECT_EQ(session.tracker->counters().tied, 1u);
}

TEST(Lost, ABoardInFrontOfTheLensOpensASegmentThatEndsWhenItGoes) {
  const PatchScene scene = test::room();
  PatchScene board;
  board.rectangles = {{{0, 0, 0.5}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 2, 2}};
  TrackSession session;
  for (int i = 0; i < 20; ++i) session.step(scene, wandering(0.033 * i));
  EXPECT_EQ(session.step(board, Se3{}).loss, Loss::kFewInliers);
  for (int i = 0; i < 29; ++i) session.step(board, Se3{});
  EXPECT_EQ(session.tracker->counters().segments, 1u);
  Track track;
  for (int i = 0; i < 40; ++i) track = session.step(scene, wandering(0.033 * 20));
  ASSERT_EQ(track.state, Track::State::kTracking);
  EXPECT_EQ(session.tracker->counters().tied, 1u);
  const Se3 truth = wandering(0.0).inverse() * wandering(0.033 * 20);
  EXPECT_LT((truth.inverse() * track.T_odom_camera.se3).t.norm(), 0.02);
}

TEST(Lost, WhatNoCameraCanDoIsALossUntilTimeMakesItPossible) {
  const PatchScene scene = test::room();
  TrackSession session;
  for (int i = 0; i < 10; ++i) session.step(scene, Se3{});
  // 18 cm in 33 ms: the scene, or most of it, was moved.
  const Se3 there = Se3::exp(0.18 * Vector6d::Unit(0));
  Track track = session.step(scene, there);
  EXPECT_EQ(track.state, Track::State::kLost);
  EXPECT_EQ(track.loss, Loss::kInconsistent);
  int frames = 1;
  while (track.state == Track::State::kLost && frames < 10) {
    track = session.step(scene, there);
    ++frames;
  }
  EXPECT_LE(frames, 4);
  EXPECT_LT((there.inverse() * track.T_odom_camera.se3).t.norm(), 0.02);
  EXPECT_EQ(session.tracker->counters().by_loss[static_cast<std::size_t>(Loss::kInconsistent)],
            session.tracker->counters().lost);
  EXPECT_EQ(session.tracker->counters().segments, 0u);
}

TEST(Lost, ACutIsNotTakenForStandingStill) {
  const PatchScene scene = test::room();
  for (int k = 1; k < 8; ++k) {
    TrackSession session;
    for (int i = 0; i < 20; ++i) session.step(scene, wandering(0.033 * i));
    // 0.6 m and more than 36 deg aside, from one frame to the next.
    Vector6d xi;
    xi << 0.6 * std::cos(k), 0.0, 0.6 * std::sin(k), 0.0, k % 2 == 0 ? 0.64 : -0.75, 0.0;
    const Se3 there = wandering(0.66) * Se3::exp(xi);
    const Se3 truth = wandering(0.0).inverse() * there;
    for (int i = 0; i < 3; ++i) {
      const Track track = session.step(scene, there);
      if (track.state == Track::State::kLost) continue;
      EXPECT_LT((truth.inverse() * track.T_odom_camera.se3).t.norm(), 0.03) << k << ' ' << i;
    }
  }
}

TEST(Lost, AnotherRoomAtOnceIsNotTakenForThisOne) {
  PatchScene other;
  other.add_box({-2.4, -1.4, -2.0}, {2.2, 1.2, 4.4});
  other.add_box({-0.6, 0.3, 1.6}, {0.5, 1.2, 2.3});
  TrackSession session;
  for (int i = 0; i < 20; ++i) session.step(test::room(), wandering(0.033 * i));
  EXPECT_EQ(session.step(other, wandering(0.0)).loss, Loss::kFewInliers);
  for (int i = 0; i < 10; ++i) session.step(other, wandering(0.0));
  EXPECT_EQ(session.tracker->counters().segments, 1u);
}

// A corridor with a door frame: what shows where along it one stands is a small part of the view.
TEST(Lost, AfterTheDarkTheKeyframeThatFitsHasTheWord) {
  PatchScene scene = test::corridor();
  scene.add_box({-1.0, -1.3, 2.6}, {-0.7, 1.2, 2.9});
  scene.add_box({0.6, -0.2, 3.3}, {1.0, 1.2, 3.7});
  TrackSession session;
  for (int i = 0; i < 40; ++i) session.step(scene, Se3::exp(0.015 * i * Vector6d::Unit(2)));
  darken(session, 60);
  Track track;
  Se3 truth;
  for (int i = 0; i < 40; ++i) {
    truth = Se3::exp(0.01 * i * Vector6d::Unit(2));
    track = session.step(scene, truth);
  }
  ASSERT_EQ(track.state, Track::State::kTracking);
  EXPECT_LT((truth.inverse() * track.T_odom_camera.se3).t.norm(), 0.02);
}

// Four bare corners: the next one fits as well as the one that was lost.
TEST(Lost, AfterTheDarkACornerThatLooksAlikeIsNotTakenForTheOneThatWasLost) {
  PatchScene scene;
  scene.add_box({-2.5, -1.4, -2.5}, {2.5, 1.2, 2.5});
  for (const double turn : {0.5 * M_PI, M_PI, 0.0}) {
    TrackSession session;
    const Se3 corner = turned(0.7);
    for (int i = 0; i < 20; ++i) session.step(scene, corner * wandering(0.033 * i));
    darken(session, 50);
    for (int i = 0; i < 60; ++i) {
      session.step(scene, turned(turn) * corner * wandering(0.66 + 0.033 * i));
    }
    EXPECT_EQ(session.last_keyframe->segment, 1u) << turn;
    EXPECT_EQ(session.tracker->counters().recovered, 0u) << turn;
    const auto& by_loss = session.tracker->counters().by_loss;
    EXPECT_EQ(by_loss[static_cast<std::size_t>(Loss::kUnsure)], 4u) << turn;
  }
}

TEST(Lost, AGapSaysThatTheTurnIsUnknown) {
  const PatchScene scene = test::room();
  PatchScene other;
  other.add_box({-2.4, -1.4, -2.0}, {2.2, 1.2, 4.4});
  other.add_box({-0.6, 0.3, 1.6}, {0.5, 1.2, 2.3});
  TrackSession session;
  for (int i = 0; i < 20; ++i) session.step(scene, wandering(0.033 * i));
  for (int i = 0; i < 12 && session.last_keyframe->segment == 0; ++i) {
    session.step(other, wandering(0.0));  // a jump cut
  }
  ASSERT_EQ(session.last_keyframe->segment, 1u);
  const Matrix6d& covariance = session.last_keyframe->covariance;
  EXPECT_NEAR(std::sqrt(covariance(0, 0)), 3.0, 0.1);
  EXPECT_NEAR(std::sqrt(covariance(4, 4)), 1.8, 0.1);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>{covariance}.eigenvalues()[0], 0.0);
}

TEST(Lost, AStampADayAheadIsAGap) {
  const PatchScene scene = test::room();
  TrackSession session;
  for (int i = 0; i < 20; ++i) session.step(scene, wandering(0.033 * i));
  const auto before = session.last_keyframe->blind_spells;
  session.stamp_offset = std::chrono::hours{27};
  Track track = session.step(scene, wandering(0.66));
  EXPECT_TRUE(track.leapt);
  EXPECT_EQ(track.loss, Loss::kUnsure) << "one frame proves nothing";
  for (int i = 0; i < 20 && track.state == Track::State::kLost; ++i) {
    track = session.step(scene, wandering(0.66));
    EXPECT_FALSE(track.leapt);
  }
  ASSERT_EQ(track.state, Track::State::kTracking) << "the view is recognised";
  EXPECT_TRUE(track.keyframe_due);
  EXPECT_GT(session.last_keyframe->blind_spells, before) << "no maplet reaches over it";
  EXPECT_EQ(session.tracker->counters().leaps, 1u);
  EXPECT_EQ(session.tracker->counters().recovered, 1u);
}

TEST(Lost, SaysWhy) {
  const PatchScene scene = test::room();
  TrackSession session;
  for (int i = 0; i < 5; ++i) session.step(scene, Se3{});
  session.patches->clear();
  EXPECT_EQ(session.feed().loss, Loss::kNoDepth);
  session.patches->clear();
  session.patches->camera = scene.camera;
  session.patches->valid_pixels = 640 * 480 / 50;  // speckles under a finger
  EXPECT_EQ(session.feed().loss, Loss::kCovered);
  session.patches->valid_pixels = 640 * 480 / 2;  // a hedge
  EXPECT_EQ(session.feed().loss, Loss::kFewPatches);
  EXPECT_EQ(session.step(scene, Se3{}).loss, Loss::kNone);
  const auto& by_loss = session.tracker->counters().by_loss;
  EXPECT_EQ(by_loss[static_cast<std::size_t>(Loss::kNoDepth)], 1u);
  EXPECT_EQ(by_loss[static_cast<std::size_t>(Loss::kCovered)], 1u);
  EXPECT_EQ(by_loss[static_cast<std::size_t>(Loss::kFewPatches)], 1u);
}

}  // namespace
}  // namespace maplet
