// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/builder.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "core/maplet/codec.hpp"
#include "tests/support/synthetic_keyframes.hpp"

namespace maplet {
namespace {

// Walks a path and keeps every maplet that comes out.
class Walk {
 public:
  explicit Walk(const MapletConfig& config = {},
                const std::vector<test::Wall>& walls = test::room())
      : builder_{config, arena_}, walls_{walls}, keyframe_{std::make_unique<Keyframe>()} {
    builder_.identify(2, 77, 5);
  }

  void step(const Se3& T_world_camera, std::mt19937* noise = nullptr) {
    if (walls_.empty()) {
      keyframe_->patches.patches.clear();
      keyframe_->patches.planes.clear();
    } else {
      test::render(walls_, T_world_camera, *keyframe_, noise);
    }
    keyframe_->stamp = Stamp{1'000'000'000} + ++steps_ * Stamp{100'000'000};
    keyframe_->T_odom_camera.se3 = T_world_camera;
    keyframe_->covariance = Matrix6d::Identity() * 1e-6;
    keep(builder_.add(*keyframe_, Deadline::never()));
  }
  void finish() { keep(builder_.finish()); }
  void lose() { ++keyframe_->segment; }

  struct Kept {
    std::unique_ptr<Maplet> maplet;
    PathLink link;
    CutReason reason;
    std::size_t bytes;
  };
  std::vector<Kept> maplets;
  [[nodiscard]] const MapletCounts& counts() const { return builder_.counts(); }

 private:
  void keep(const MapletCut* cut) {
    if (cut == nullptr) return;
    maplets.push_back(
        {std::make_unique<Maplet>(cut->maplet), cut->link, cut->reason, cut->bytes.size()});
  }

  Arena arena_;
  MapletBuilder builder_;
  std::vector<test::Wall> walls_;
  std::unique_ptr<Keyframe> keyframe_;
  std::int64_t steps_ = 0;
};

Se3 camera(double x, double y, double heading) { return test::camera_at({x, y, 1.2}, heading); }

TEST(MapletBuilder, ExactViewsGiveExactPlanes) {
  Walk walk;
  for (int i = 0; i < 8; ++i) walk.step(camera(1.5 + 0.1 * i, 2.5, 0.1 * i));
  walk.finish();
  ASSERT_EQ(walk.maplets.size(), 1U);
  const Maplet& m = *walk.maplets[0].maplet;
  EXPECT_EQ(m.key, (MapletKey{2, 77, 5}));
  EXPECT_EQ(m.keyframes.size(), 8U);
  ASSERT_GE(m.planes.size(), 5U);
  const Se3 T_maplet_world = camera(1.5, 2.5, 0.0).inverse();
  for (const MapletPlane& p : m.planes) {
    double nearest = 1e9;
    for (const test::Wall& w : test::room()) {
      const Eigen::Vector3d n = T_maplet_world.q * w.normal();
      nearest = std::min(
          nearest, (n - p.plane.n).norm() + std::abs(p.plane.distance(T_maplet_world * w.centre)));
    }
    EXPECT_LT(nearest, 1e-3);
  }
  EXPECT_EQ(walk.counts().patches_unfit, 0U);
}

TEST(MapletBuilder, OneSurfaceIsOnePlaneAndCellsLieOnWalls) {
  Walk walk;
  for (int i = 0; i < 8; ++i) walk.step(camera(1.5 + 0.1 * i, 2.5, 0.1 * i));
  walk.finish();
  const Maplet& m = *walk.maplets.at(0).maplet;
  EXPECT_LE(m.planes.size(), test::room().size());
  const Se3 T_world_maplet = camera(1.5, 2.5, 0.0);
  std::size_t astray = 0;
  std::size_t all = 0;
  for (const MapletPlane& p : m.planes) {
    const double size = m.cell_m_of(p.grid);
    for (int r = 0; r < p.grid.rows; ++r) {
      for (int c = 0; c < p.grid.columns; ++c) {
        if (!m.cell(p.grid, c, r)) continue;
        const Eigen::Vector3d at =
            T_world_maplet *
            p.basis().point((p.grid.column0 + c + 0.5) * size, (p.grid.row0 + r + 0.5) * size);
        bool on = false;
        for (const test::Wall& w : test::room()) {
          const Eigen::Vector3d off = at - w.centre;
          on |= std::abs(off.dot(w.normal())) < 5e-3 &&
                std::abs(off.dot(w.half_a.normalized())) < w.half_a.norm() + 0.06 &&
                std::abs(off.dot(w.half_b.normalized())) < w.half_b.norm() + 0.06;
        }
        astray += on ? 0 : 1;
        ++all;
      }
    }
  }
  EXPECT_GT(all, 2000U);
  EXPECT_EQ(astray, 0U);
}

TEST(MapletBuilder, EndsAtThePathLimitAndOverlaps) {
  MapletConfig config;
  config.max_path_m = 1.0;
  config.overlap_keyframes = 2;
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

TEST(MapletBuilder, TurningAndBendingEndMaplets) {
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

TEST(MapletBuilder, LossStartsAnUnconnectedMapletLinkedLoosely) {
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

TEST(MapletBuilder, NeverExceedsItsBytes) {
  MapletConfig config;
  config.max_bytes = 1024;
  Walk walk{config};
  for (int i = 0; i < 40; ++i) walk.step(camera(1.5 + 0.05 * i, 2.5, 0.02 * i));
  walk.finish();
  ASSERT_GE(walk.maplets.size(), 2U);
  for (const auto& kept : walk.maplets) EXPECT_LE(kept.bytes, 1024U);
}

TEST(MapletBuilder, NothingSeenIsAMapletWithoutPlanes) {
  Walk walk{{}, {}};
  for (int i = 0; i < 3; ++i) walk.step(camera(1.5 + 0.1 * i, 2.5, 0.0));
  walk.finish();
  ASSERT_EQ(walk.maplets.size(), 1U);
  EXPECT_TRUE(walk.maplets[0].maplet->planes.empty());
  EXPECT_EQ(walk.maplets[0].maplet->keyframes.size(), 3U);
  walk.finish();
  EXPECT_EQ(walk.maplets.size(), 1U);
}

// A poster that is gone later: its cells were seen through and go too.
TEST(MapletBuilder, SurfaceThatIsSeenThroughGoes) {
  auto walls = test::room();
  walls.push_back({{3.0, 2.5, 1.2}, {0, 0, 0.3}, {0, 0.3, 0}});  // faces the camera, n = -x
  auto with = std::make_unique<Keyframe>();
  auto without = std::make_unique<Keyframe>();
  Arena arena;
  MapletBuilder builder{{}, arena};
  for (int i = 0; i < 8; ++i) {
    Keyframe& k = i < 2 ? *with : *without;
    const Se3 T = camera(1.0 + 0.05 * i, 2.5, 0.0);
    test::render(i < 2 ? walls : test::room(), T, k);
    k.T_odom_camera.se3 = T;
    k.stamp = Stamp{i};
    EXPECT_EQ(builder.add(k, Deadline::never()), nullptr);
  }
  const MapletCut* cut = builder.finish();
  ASSERT_NE(cut, nullptr);
  const Eigen::Vector3d poster = camera(1.0, 2.5, 0.0).inverse() * Eigen::Vector3d{3.0, 2.5, 1.2};
  for (const MapletPlane& p : cut->maplet.planes) {
    EXPECT_FALSE(std::abs(p.plane.distance(poster)) < 0.05 && cut->maplet.covers(p, poster));
  }
}

// Squared normalised errors of plane estimates average to their degrees of freedom.
TEST(MapletBuilder, PlaneCovarianceIsHonest) {
  MapletConfig config;
  config.floor_m = 0.0;
  config.floor_rad = 0.0;
  std::mt19937 rng{11};
  double sum = 0.0;
  int count = 0;
  for (int run = 0; run < 30; ++run) {
    Walk walk{config};
    for (int i = 0; i < 6; ++i) walk.step(camera(1.5 + 0.1 * i, 2.5, 0.05 * i), &rng);
    walk.finish();
    const Maplet& m = *walk.maplets.at(0).maplet;
    const Se3 T_maplet_world = camera(1.5, 2.5, 0.0).inverse();
    for (const MapletPlane& p : m.planes) {
      for (const test::Wall& w : test::room()) {
        Plane truth;
        truth.n = T_maplet_world.q * w.normal();
        truth.d = -truth.n.dot(T_maplet_world * w.centre);
        if (truth.n.dot(p.plane.n) < 0.99 || std::abs(truth.distance(p.centre)) > 0.1) continue;
        const PlaneBasis basis = p.basis();
        const PlaneTangent tangent{basis.u, basis.v, p.plane.n, p.centre};
        const Eigen::Vector3d error = tangent.of(truth);
        sum += error.dot(p.covariance.inverse() * error);
        count += 3;
      }
    }
  }
  ASSERT_GT(count, 300);
  // Keyframe poses are exact here while their covariance is counted: below 1.
  EXPECT_GT(sum / count, 0.1);
  EXPECT_LT(sum / count, 1.3);
}

}  // namespace
}  // namespace maplet
