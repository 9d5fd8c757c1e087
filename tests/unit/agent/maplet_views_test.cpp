// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/maplet_views.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "core/agent/maplet_drawing.hpp"
#include "core/maplet/builder.hpp"
#include "core/odometry/tracker.hpp"
#include "tests/support/synthetic_keyframes.hpp"

namespace maplet {
namespace {

Se3 along(double m, double rad) {
  Vector6d xi = Vector6d::Zero();
  xi[0] = m;
  xi[4] = rad;
  return Se3::exp(xi);
}

// A camera in the room, the first one looking into a corner.
Se3 in_the_room(const Se3& T_first_camera) {
  Eigen::Matrix3d R;
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return Se3{Eigen::Quaterniond{R}, Eigen::Vector3d{2.5, 2.2, 1.2}} * along(0.0, -0.7) *
         T_first_camera;
}

TEST(MapletDrawing, PutsPlanesWhereTheCameraSeesThem) {
  const auto walls = test::room();
  auto maplet = std::make_unique<Maplet>();
  for (const auto& wall : walls) test::add_wall(*maplet, wall, Se3{});
  auto keyframe = std::make_unique<Keyframe>();
  const Se3 at = in_the_room(along(0.3, 0.2));
  test::render(walls, at, *keyframe);
  auto drawn = std::make_unique<PatchSet>();
  draw_maplet(*maplet, at, keyframe->patches.camera, *drawn);
  ASSERT_GT(drawn->patches.size(), keyframe->patches.patches.size());
  // Each patch of the view lies on the one drawn at its middle.
  std::size_t same = 0;
  for (const Patch& seen : keyframe->patches.patches) {
    const double u = seen.u_px + 0.5 * seen.width_px;
    const double v = seen.v_px + 0.5 * seen.height_px;
    for (const Patch& patch : drawn->patches) {
      if (u < patch.u_px || v < patch.v_px || u >= patch.u_px + patch.width_px ||
          v >= patch.v_px + patch.height_px) {
        continue;
      }
      if ((patch.theta - seen.theta).norm() < 1e-6) ++same;
    }
  }
  EXPECT_GT(static_cast<double>(same),
            0.97 * static_cast<double>(keyframe->patches.patches.size()));
}

// What stands in front of the corner tells it from others.
std::vector<test::Wall> room_with_crate() {
  using V = Eigen::Vector3d;
  auto walls = test::room();
  walls.push_back({V{4.6, 4.2, 0.7}, V{0, 0, 0.7}, V{0, 0.6, 0}});  // n = -x
  walls.push_back({V{5.0, 3.6, 0.7}, V{0.4, 0, 0}, V{0, 0, 0.7}});  // n = -y
  return walls;
}

// A tracker that walks away from its first view, makes maplets of its keyframes and is lost.
class Walk {
 public:
  Walk()
      : store_{64, 4096, 16384, arena_},
        views_{store_, arena_},
        builder_{maplet_, ImageSize{640, 480}, arena_} {
    tracker_ = std::make_unique<Tracker>(odometry_, arena_);
  }
  void hold_maplets() { tracker_->look_through(views_); }

  Track step(const Se3& T_first_camera) {
    test::render(walls_, in_the_room(T_first_camera), *seen_, &noise_);
    return feed();
  }
  Track feed() {
    frame_.stamp = std::chrono::milliseconds{33} * ++steps_;
    const Track track = tracker_->run(frame_, seen_->patches, Deadline::never());
    if (track.keyframe_due) {
      const Keyframe& keyframe = tracker_->make_keyframe(frame_, seen_->patches, track);
      views_.saw(keyframe);
      if (const MapletCut* cut = builder_.add(keyframe, nullptr, Deadline::never())) {
        (void)store_.put(cut->maplet.key, cut->bytes);
        views_.add(cut->maplet);
      }
      ++keyframes;
    }
    return track;
  }
  void darken() {
    for (int i = 0; i < 30; ++i) {
      seen_->patches.clear();
      feed();
    }
  }
  // Round and round in place, away from the first view, until its keyframes are gone.
  void leave() {
    for (int i = 0; i < 10; ++i) step(Se3{});
    for (int i = 0; i < 90; ++i)
      ASSERT_EQ(step(along(0.0, 0.03 * i)).state, Track::State::kTracking);
    const int before = keyframes;
    for (int i = 0; i < 900 && keyframes < before + 14; ++i) {
      const double s = 0.05 * i;
      const Se3 there = along(0.0, 2.7) * along(0.35 * std::sin(s), 0.25 * std::sin(0.7 * s));
      ASSERT_EQ(step(there).state, Track::State::kTracking) << i;
    }
    ASSERT_GE(keyframes, before + 14);
  }

  int keyframes = 0;
  [[nodiscard]] const Tracker& tracker() const { return *tracker_; }
  [[nodiscard]] const MapletViews& views() const { return views_; }

 private:
  Arena arena_;
  OdometryConfig odometry_;
  MapletConfig maplet_;
  MapletStore store_;
  MapletViews views_;
  MapletBuilder builder_;
  std::unique_ptr<Tracker> tracker_;
  std::unique_ptr<Keyframe> seen_ = std::make_unique<Keyframe>();
  std::vector<test::Wall> walls_ = room_with_crate();
  std::mt19937 noise_{5};
  DepthFrame frame_;
  int steps_ = 0;
};

TEST(MapletViews, ALostCameraIsFoundAgainWhereOnlyMapletPlanesAreHeld) {
  Walk walk;
  walk.hold_maplets();
  walk.leave();
  ASSERT_GT(walk.views().count(), 3u);
  walk.darken();
  Se3 here;
  Track track;
  for (int i = 0; i < 60 && walk.tracker().counters().in_stored_views == 0; ++i) {
    here = along(0.05 + 0.01 * std::min(i, 25),
                 0.04);  // it moves: one look from one place proves nothing
    track = walk.step(here);
  }
  ASSERT_EQ(track.state, Track::State::kTracking);
  EXPECT_EQ(walk.tracker().counters().in_stored_views, 1u);
  EXPECT_LT((here.inverse() * track.T_odom_camera.se3).t.norm(), 0.03);
  EXPECT_LT((here.inverse() * track.T_odom_camera.se3).angle(), 0.02);
}

TEST(MapletViews, WithoutThemTheSameCameraBeginsANewSegment) {
  Walk walk;
  walk.leave();
  walk.darken();
  for (int i = 0; i < 6; ++i) (void)walk.step(along(0.05, 0.04));
  EXPECT_EQ(walk.tracker().counters().in_stored_views, 0u);
  EXPECT_EQ(walk.tracker().counters().segments, 1u);
}

TEST(MapletViews, AMapletThatTheStoreForgotIsNoView) {
  Arena arena;
  MapletStore store{4, 4096, 16384, arena};
  MapletViews views{store, arena};
  Keyframe keyframe;
  keyframe.stamp = Stamp{5};
  views.saw(keyframe);
  auto maplet = std::make_unique<Maplet>();
  maplet->stamp = Stamp{5};
  maplet->keyframes.push_back({Stamp{5}, {}});
  views.add(*maplet);
  ASSERT_EQ(views.count(), 1u);
  auto drawn = std::make_unique<PatchSet>();
  EXPECT_FALSE(views.draw(0, CameraModel{320, 240, 262.0, 262.0, 159.5, 119.5}, *drawn));
  maplet->stamp = Stamp{6};  // of a keyframe that nobody saw
  views.add(*maplet);
  EXPECT_EQ(views.count(), 1u);
}

}  // namespace
}  // namespace maplet
