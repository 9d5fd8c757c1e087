// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/free_space.hpp"

#include <gtest/gtest.h>

#include <random>

#include "core/odometry/stamp_jitter.hpp"
#include "tests/support/patch_scene.hpp"

namespace maplet {
namespace {

using test::PatchScene;

struct Views {
  OdometryConfig config;
  Arena arena;
  PatchView frame{facets_of(config), arena};
  PatchView keyframe{facets_of(config), arena};
  std::mt19937 rng{3};

  void see(PatchView& view, const PatchScene& scene, const Se3& T_world_camera) {
    view.assign(scene.view(T_world_camera, rng), config);
  }
  void mark(const Se3& T_odom_camera) {
    const Reference reference{&keyframe, Se3{}};
    mark_what_moves(frame, {&reference, 1}, T_odom_camera, 0.0);
  }
  static double share_moved(const PatchView& view, double nearer_m, double farther_m) {
    double moved = 0.0;
    double all = 0.0;
    for (const Facet& facet : view.facets()) {
      if (facet.centre.z() < nearer_m || facet.centre.z() > farther_m) continue;
      all += facet.pixels;
      if (facet.moved) moved += facet.pixels;
    }
    return moved / all;
  }
};

PatchScene with_board(double x) {
  PatchScene scene = test::room();
  scene.rectangles.push_back(
      {{x, 0.0, 1.0}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 0.2, 0.5});
  return scene;
}

const Se3 kAside = Se3::exp(0.08 * Vector6d::Unit(0));

TEST(FreeSpace, WhatCameIsMarkedAndWhatStoodIsNot) {
  Views views;
  views.see(views.keyframe, test::room(), Se3{});
  views.see(views.frame, with_board(0.0), kAside);
  views.mark(kAside);
  EXPECT_GT(Views::share_moved(views.frame, 0.9, 1.1), 0.9);
  EXPECT_LT(Views::share_moved(views.frame, 1.1, 9.0), 0.02);
  EXPECT_LT(Views::share_moved(views.keyframe, 0.0, 9.0), 0.02);
}

TEST(FreeSpace, WhatWentIsMarkedInTheKeyframe) {
  Views views;
  views.see(views.keyframe, with_board(0.0), Se3{});
  views.see(views.frame, test::room(), kAside);
  views.mark(kAside);
  EXPECT_GT(Views::share_moved(views.keyframe, 0.9, 1.1), 0.8);
  EXPECT_LT(Views::share_moved(views.keyframe, 1.1, 9.0), 0.02);
  EXPECT_LT(Views::share_moved(views.frame, 0.0, 9.0), 0.02);
}

TEST(FreeSpace, WhatLiesOnWhatMovedMovesToo) {
  Views views;
  views.see(views.keyframe, with_board(0.0), Se3{});
  for (Facet& facet : views.keyframe.facets()) facet.moved = facet.centre.z() < 1.1;
  views.see(views.frame, with_board(0.0), Se3{});
  views.mark(Se3{});
  EXPECT_GT(Views::share_moved(views.frame, 0.9, 1.1), 0.9);
  EXPECT_LT(Views::share_moved(views.frame, 1.1, 9.0), 0.02);
}

TEST(FreeSpace, AStaticSceneSeenFromAsideIsLeftAlone) {
  Views views;
  views.see(views.keyframe, with_board(0.1), Se3{});
  views.see(views.frame, with_board(0.1), kAside);
  views.mark(kAside);
  EXPECT_LT(Views::share_moved(views.frame, 0.0, 9.0), 0.01);
  EXPECT_LT(Views::share_moved(views.keyframe, 0.0, 9.0), 0.01);
}

TEST(FreeSpace, WhereMostWouldMoveThePoseIsDoubtful) {
  Views views;
  views.see(views.keyframe, test::room(), Se3{});
  PatchScene covered = test::room();
  covered.rectangles.push_back(
      {{0, 0, 1.0}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 0.5, 0.5});
  views.see(views.frame, covered, Se3{});
  views.mark(Se3{});
  EXPECT_EQ(Views::share_moved(views.frame, 0.0, 9.0), 0.0);
}

TEST(StampJitter, IsWhatStrayedFromTheBeat) {
  StampJitter even;
  for (int i = 0; i < 100; ++i) even.add(0.033);
  EXPECT_EQ(even.sigma_s(), 0.0);
  StampJitter uneven;
  for (int i = 0; i < 200; ++i) uneven.add(0.033 + (i % 2 == 0 ? 0.01 : -0.01));
  EXPECT_NEAR(uneven.sigma_s(), 0.01, 0.002);
}

}  // namespace
}  // namespace maplet
