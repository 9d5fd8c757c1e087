// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "core/maplet/builder.hpp"
#include "core/maplet/codec.hpp"
#include "tests/unit/maplet/walk.hpp"

namespace maplet {
namespace {

using test::camera;
using test::Walk;

TEST(MapletCutting, EndsAtThePathLimitAndOverlaps) {
  MapletConfig config;
  config.max_path_m = 1.0;
  config.overlap_keyframes = 2;
  config.boundary_keyframes = 0;
  Walk walk{config};
  for (int i = 0; i < 25; ++i) walk.step(camera(1.0 + 0.15 * i, 2.5, 0.0));
  walk.finish();
  ASSERT_GE(walk.maplets.size(), 3U);
  for (std::size_t k = 1; k < walk.maplets.size(); ++k) {
    const auto& before = walk.maplets[k - 1];
    const auto& after = walk.maplets[k];
    EXPECT_EQ(before.reason, CutReason::kPath);
    EXPECT_EQ(after.maplet->key.id, before.maplet->key.id + 1);
    ASSERT_TRUE(after.link.valid);
    EXPECT_EQ(after.link.previous, before.maplet->key);
    // The origin is a keyframe of the one before, where the link says.
    const auto& shared = before.maplet->keyframes[before.maplet->keyframes.size() - 2];
    EXPECT_EQ(after.maplet->stamp, shared.stamp);
    const Vector6d off =
        (after.link.T_previous_this.se3.inverse() * shared.T_maplet_camera.se3).log();
    EXPECT_LT(off.norm(), 3e-4);
    EXPECT_GT(after.link.covariance.diagonal().minCoeff(), 0.0);
  }
  EXPECT_FALSE(walk.maplets[0].link.valid);
  EXPECT_EQ(walk.maplets.back().reason, CutReason::kEnd);
}

TEST(MapletCutting, TurningAndBendingEndMaplets) {
  Walk turning;
  for (int i = 0; i < 20; ++i) turning.step(camera(3.0, 2.5, 0.1 * i));
  turning.finish();
  ASSERT_GE(turning.maplets.size(), 2U);
  EXPECT_EQ(turning.maplets[0].reason, CutReason::kYaw);

  MapletConfig config;
  config.max_path_m = 50.0;
  config.max_keyframes = 32;
  Walk bending{config};
  for (int i = 0; i < 30; ++i) {  // a circle, looking one way
    bending.step(camera(3.0 + 0.8 * std::cos(0.3 * i), 2.5 + 0.8 * std::sin(0.3 * i), 0.0));
  }
  bending.finish();
  ASSERT_GE(bending.maplets.size(), 2U);
  EXPECT_EQ(bending.maplets[0].reason, CutReason::kCurvature);
}

TEST(MapletCutting, LossStartsAnUnconnectedMapletLinkedLoosely) {
  Walk walk;
  for (int i = 0; i < 4; ++i) walk.step(camera(1.5 + 0.1 * i, 2.5, 0.0));
  walk.lose();
  for (int i = 0; i < 4; ++i) walk.step(camera(3.5 + 0.1 * i, 2.5, 0.0));
  walk.finish();
  ASSERT_EQ(walk.maplets.size(), 2U);
  EXPECT_EQ(walk.maplets[0].reason, CutReason::kLost);
  EXPECT_EQ(walk.maplets[1].maplet->keyframes.size(), 4U);
  EXPECT_TRUE(walk.maplets[1].link.valid);
  EXPECT_NEAR(walk.maplets[1].link.T_previous_this.se3.t.z(), 2.0, 1e-6);
}

// A range was measured at a keyframe: an origin there, and both maplets hold it.
TEST(MapletCutting, AMeasurementGetsItsOrigin) {
  Walk walk;
  for (int i = 0; i < 5; ++i) walk.step(camera(1.5 + 0.1 * i, 2.5, 0.0));
  walk.builder().ask_origin();
  walk.step(camera(2.0, 2.5, 0.1));
  const Stamp asked = walk.keyframe().stamp;
  for (int i = 0; i < 5; ++i) walk.step(camera(2.1 + 0.1 * i, 2.5, 0.1));
  walk.finish();
  ASSERT_EQ(walk.maplets.size(), 2U);
  EXPECT_EQ(walk.maplets[0].reason, CutReason::kAsked);
  EXPECT_EQ(walk.maplets[0].maplet->keyframes.back().stamp, asked);
  EXPECT_EQ(walk.maplets[1].maplet->stamp, asked);
  EXPECT_EQ(walk.maplets[1].maplet->keyframes.size(), 6U);
  ASSERT_TRUE(walk.maplets[1].link.valid);
  EXPECT_NEAR(walk.maplets[1].link.T_previous_this.se3.t.norm(), 0.5, 1e-3);
}

TEST(MapletCutting, AMomentOnThePathIsTiedToItsMaplet) {
  Walk walk;
  for (int i = 0; i < 4; ++i) walk.step(camera(1.5 + 0.1 * i, 2.5, 0.0));
  Track track;
  track.state = Track::State::kTracking;
  track.keyframe_id = walk.keyframe().id;
  track.stamp = Stamp{5};
  track.T_keyframe_camera.se3.t = {0.0, 0.0, 0.05};
  track.covariance = 1e-6 * Matrix6d::Identity();
  const auto here = walk.builder().locate(track);
  ASSERT_TRUE(here);
  EXPECT_EQ(here->maplet, (MapletKey{2, 77, 5}));
  EXPECT_NEAR(here->T_maplet_camera.se3.t.z(), 0.35, 1e-3);
  // Three keyframes and the frame itself.
  EXPECT_NEAR(here->covariance(2, 2), 4e-6, 1e-7);
  track.keyframe_id += 1;
  EXPECT_FALSE(walk.builder().locate(track));
  track.state = Track::State::kLost;
  EXPECT_FALSE(walk.builder().locate(track));
}

// Round the end of a wall: the line from origin to origin must not cross it.
TEST(MapletCutting, OriginsSeeEachOther) {
  MapletConfig config;
  config.max_path_m = 50.0;
  config.max_yaw_rad = 6.0;
  config.max_curvature_rad = 50.0;
  auto walls = test::room();
  // Across the room from y = 0 to 3.4, seen from both sides.
  walls.push_back({{3.0, 1.7, 1.3}, {0, 0, 1.3}, {0, 1.7, 0}});
  walls.push_back({{3.02, 1.7, 1.3}, {0, 1.7, 0}, {0, 0, 1.3}});
  Walk walk{config, walls};
  std::vector<Eigen::Vector2d> path;
  for (int i = 0; i <= 12; ++i) path.push_back({1.0 + 0.1 * i, 1.0 + 0.24 * i});
  for (int i = 1; i <= 4; ++i) path.push_back({2.2 + 0.4 * i, 3.88});
  for (int i = 1; i <= 12; ++i) path.push_back({3.8 + 0.05 * i, 3.88 - 0.24 * i});
  for (const auto& p : path) walk.step(camera(p.x(), p.y(), p.x() < 3.0 ? 0.0 : 3.14));
  walk.finish();
  ASSERT_GE(walk.maplets.size(), 2U);
  EXPECT_EQ(walk.maplets[0].reason, CutReason::kHidden);
  EXPECT_EQ(walk.counts().hidden_origins, 0U);
  for (std::size_t k = 1; k < walk.maplets.size(); ++k) {
    const auto origin = [&](std::size_t i) {
      const auto step = (walk.maplets[i].maplet->stamp.count() - 1'100'000'000) / 100'000'000;
      return path[static_cast<std::size_t>(step)];
    };
    const Eigen::Vector2d a = origin(k - 1);
    const Eigen::Vector2d b = origin(k);
    if ((a.x() - 3.0) * (b.x() - 3.0) >= 0.0) continue;
    EXPECT_GT(a.y() + (3.0 - a.x()) / (b.x() - a.x()) * (b.y() - a.y()), 3.4);
  }
}

// Bare walls but for one view: the next origin is there.
TEST(MapletCutting, TheBoundaryMovesToStructure) {
  using V = Eigen::Vector3d;
  auto bare = test::room();
  bare.resize(6);
  auto furnished = bare;
  for (int i = 0; i < 6; ++i) {
    furnished.push_back(
        {V{4.5, 1.2 + 0.52 * i, 0.8 + 0.4 * (i % 3)}, V{0, 0, 0.25}, V{0, 0.25, 0}});
  }
  for (const int special : {5, 6, 7}) {
    MapletConfig config;
    config.max_keyframes = 8;
    Walk walk{config, bare};
    for (int i = 0; i < 12; ++i) {
      walk.show(i == special ? furnished : bare);
      walk.step(camera(1.0 + 0.05 * i, 2.5, 0.0));
    }
    walk.finish();
    ASSERT_GE(walk.maplets.size(), 2U);
    EXPECT_EQ(walk.maplets[1].maplet->stamp, Stamp{1'100'000'000 + special * 100'000'000LL});
  }
}

}  // namespace
}  // namespace maplet
