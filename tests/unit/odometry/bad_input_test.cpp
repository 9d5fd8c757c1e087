// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What a camera may do to a tracker: stamps, covers, bursts.
#include <gtest/gtest.h>

#include <random>

#include "tests/support/track_session.hpp"

namespace maplet {
namespace {

using test::PatchScene;
using test::TrackSession;
using test::wandering;

void expect_near_truth(const Track& track, double s, double limit_m) {
  ASSERT_EQ(track.state, Track::State::kTracking) << s;
  const Se3 truth = wandering(0.0).inverse() * wandering(s);
  ASSERT_LT((truth.inverse() * track.T_odom_camera.se3).t.norm(), limit_m) << s;
}

TEST(BadInput, AStampFarInTheFutureDoesNotThrowThePoseAway) {
  const PatchScene scene = test::room();
  TrackSession session;
  for (int i = 0; i < 60; ++i) {
    session.stamp_offset = i == 30 ? std::chrono::hours{1} : Duration{0};
    const Track track = session.step(scene, wandering(0.033 * i));
    if (i == 30) continue;  // an hour later anything may have happened
    expect_near_truth(track, 0.033 * i, 0.02);
  }
  EXPECT_EQ(session.tracker->counters().lost, 1u);
  // The stamps after the wrong one went back: after three of them the new time is followed.
  EXPECT_EQ(session.tracker->counters().not_forward, 3u);
}

TEST(BadInput, FramesInTheWrongOrderAreCountedAndTracked) {
  const PatchScene scene = test::room();
  TrackSession session;
  for (int i = 0; i < 60; ++i) {
    // 21 and 22 change places, stamps and views.
    const int shown = i == 21 ? 22 : i == 22 ? 21 : i;
    session.stamp_offset = std::chrono::milliseconds{33} * (shown - i);
    expect_near_truth(session.step(scene, wandering(0.033 * shown)), 0.033 * shown, 0.02);
  }
  EXPECT_EQ(session.tracker->counters().not_forward, 1u);
}

TEST(BadInput, HalfOfTheImageMayBeCovered) {
  const PatchScene scene = test::room();
  TrackSession session;
  for (int i = 0; i < 60; ++i) {
    *session.patches = scene.view(wandering(0.033 * i), session.rng);
    if (i >= 20 && i < 40) {
      std::size_t kept = 0;
      for (const Patch& patch : session.patches->patches) {
        if (patch.u_px >= 320) session.patches->patches[kept++] = patch;
      }
      while (session.patches->patches.size() > kept) session.patches->patches.pop_back();
    }
    expect_near_truth(session.feed(), 0.033 * i, 0.03);
  }
}

TEST(BadInput, KeyframeRateGapsAreBridged) {
  const PatchScene scene = test::room();
  TrackSession session;
  for (int i = 0; i < 30; ++i) {
    // Every sixth frame: up to 10 cm and 6 deg from one to the next.
    session.stamp_offset = std::chrono::milliseconds{165} * i;
    expect_near_truth(session.step(scene, wandering(0.198 * i)), 0.198 * i, 0.02);
  }
  EXPECT_EQ(session.tracker->counters().lost, 0u);
}

TEST(BadInput, StampsThatJitterByHalfAFrame) {
  const PatchScene scene = test::room();
  TrackSession session;
  std::mt19937 rng{5};
  std::uniform_int_distribution<int> jitter_ms{-16, 16};
  for (int i = 0; i < 150; ++i) {
    session.stamp_offset = std::chrono::milliseconds{jitter_ms(rng)};
    expect_near_truth(session.step(scene, wandering(0.033 * i)), 0.033 * i, 0.015);
  }
  EXPECT_EQ(session.tracker->counters().lost, 0u);
}

// A rounded body, nearer than all else, over a third of the image: it alone looks like a room that
// moves.
void add_body(PatchScene& scene, const Se3& T_world_body) {
  constexpr int kFacets = 6;
  for (int k = 0; k < kFacets; ++k) {
    const double a = M_PI * (k + 0.5) / kFacets;
    const Eigen::Vector3d outwards{-std::cos(a), 0.0, -std::sin(a)};
    const Eigen::Vector3d along{std::sin(a), 0.0, -std::cos(a)};
    scene.rectangles.push_back({T_world_body * (0.25 * outwards), T_world_body.q * along,
                                T_world_body.q * Eigen::Vector3d::UnitY(), 0.07, 0.6});
  }
}

TEST(BadInput, ABodyThatWalksThroughDoesNotTakeTheTrackAlong) {
  PatchScene scene = test::room();
  const std::size_t walls = scene.rectangles.size();
  TrackSession session;
  for (int i = 0; i < 110; ++i) {
    scene.rectangles.resize(walls);
    add_body(scene, wandering(0.0) * Se3::exp((-1.0 + 0.02 * i) * Vector6d::Unit(0)) *
                        Se3::exp(1.1 * Vector6d::Unit(2)));
    expect_near_truth(session.step(scene, wandering(0.01 * i)), 0.01 * i, 0.01);
  }
}

// The camera turns towards him: he comes out of what no keyframe has seen yet, nearer than all that
// one has.
TEST(BadInput, ABodyThatTheCameraTurnsToDoesNotTakeTheTrackAlong) {
  PatchScene scene = test::room();
  const std::size_t walls = scene.rectangles.size();
  TrackSession session;
  for (int i = 0; i < 60; ++i) {
    const Se3 truth = Se3::exp(0.012 * i * Vector6d::Unit(4));
    scene.rectangles.resize(walls);
    add_body(scene, truth * Se3::exp((1.0 - 0.025 * i) * Vector6d::Unit(0)) *
                        Se3::exp(1.1 * Vector6d::Unit(2)));
    const Track track = session.step(scene, truth);
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    ASSERT_LT((truth.inverse() * track.T_odom_camera.se3).t.norm(), 0.03) << i;
  }
}

TEST(BadInput, AnEmptyFrameAmongGoodOnesIsLostAlone) {
  const PatchScene scene = test::room();
  TrackSession session;
  for (int i = 0; i < 40; ++i) {
    if (i % 10 == 5) {
      session.patches->clear();
      EXPECT_EQ(session.feed().state, Track::State::kLost);
      continue;
    }
    expect_near_truth(session.step(scene, wandering(0.033 * i)), 0.033 * i, 0.02);
  }
  EXPECT_EQ(session.tracker->counters().lost, 4u);
  EXPECT_EQ(session.tracker->counters().recovered, 4u);
}

}  // namespace
}  // namespace maplet
