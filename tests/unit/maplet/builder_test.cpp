// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/builder.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "core/maplet/codec.hpp"
#include "tests/unit/maplet/walk.hpp"

namespace maplet {
namespace {

using test::camera;
using test::Walk;

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
  MapletBuilder builder{{}, {320, 240}, arena};
  for (int i = 0; i < 8; ++i) {
    Keyframe& k = i < 2 ? *with : *without;
    const Se3 T = camera(1.0 + 0.05 * i, 2.5, 0.0);
    test::render(i < 2 ? walls : test::room(), T, k);
    k.T_odom_camera.se3 = T;
    k.stamp = Stamp{i};
    EXPECT_EQ(builder.add(k, nullptr, Deadline::never()), nullptr);
  }
  const MapletCut* cut = builder.finish();
  ASSERT_NE(cut, nullptr);
  const Eigen::Vector3d poster = camera(1.0, 2.5, 0.0).inverse() * Eigen::Vector3d{3.0, 2.5, 1.2};
  for (const MapletPlane& p : cut->maplet.planes) {
    EXPECT_FALSE(std::abs(p.plane.distance(poster)) < 0.05 && cut->maplet.covers(p, poster));
  }
}

// What was added to a plane is looked at again where the plane is in the end.
TEST(PlaneMap, CellsSeenThroughTheSettledPlaneGo) {
  const std::vector<test::Wall> wall{{{4.0, 2.5, 1.2}, {0, 0, 1.0}, {0, 1.2, 0}}};
  Keyframe k;
  test::render(wall, camera(1.0, 2.5, 0.0), k);
  const CameraModel& c = k.patches.camera;
  std::vector<std::uint16_t> wall_mm(static_cast<std::size_t>(c.width_px * c.height_px), 3000);
  std::vector<std::uint16_t> window_mm = wall_mm;  // its left half is open
  for (std::size_t i = 0; i < window_mm.size(); ++i) {
    if (static_cast<int>(i) % c.width_px < c.width_px / 2) window_mm[i] = 6000;
  }
  const auto cells_with = [&](const std::vector<std::uint16_t>* depth_mm, Deadline deadline) {
    Arena arena;
    PlaneMap map{{}, arena};
    KeptDepth depth{{c.width_px, c.height_px}, arena};
    depth.draw(k.patches);
    map.add(k.patches, depth, Se3{}, Matrix6d::Identity() * 1e-6, Deadline::never());
    std::vector<KeyframeLook> looks;
    if (depth_mm != nullptr) {
      DepthFrame frame;
      frame.camera = c;
      frame.depth = {depth_mm->data(), c.width_px, c.height_px, c.width_px};
      depth.take(frame);
      looks.push_back({Se3{}, &depth});
    }
    const auto out = std::make_unique<Maplet>();
    map.assemble(*out, looks, kMaxMapletPlanes, deadline);
    EXPECT_EQ(out->planes.size(), 1U);
    return out->planes.empty() ? 0 : out->planes[0].grid.occupied;
  };
  const auto all = cells_with(nullptr, Deadline::never());
  EXPECT_GT(all, 1000U);
  EXPECT_EQ(cells_with(&wall_mm, Deadline::never()), all);
  EXPECT_NEAR(cells_with(&window_mm, Deadline::never()), all / 2, all / 20);
  const ManualClock clock;
  EXPECT_EQ(cells_with(&window_mm, Deadline{clock, Duration{0}}),
            all);  // no time: as they were added
}

TEST(MapletBuilder, UpIsFoundOnTheFloorGivenOrUnknown) {
  const auto up_of_first = [](const Vector3OrAuto& up, const std::vector<test::Wall>& walls) {
    Walk walk{{}, walls};
    walk.builder().know_up({up});
    for (int i = 0; i < 4; ++i) walk.step(camera(1.5 + 0.1 * i, 2.5, 0.0));
    walk.finish();
    return Eigen::Vector3d{walk.maplets.at(0).maplet->up};
  };
  EXPECT_LT((up_of_first({}, test::room()) - Eigen::Vector3d{0, -1, 0}).norm(), 1e-3);
  const std::vector<test::Wall> one_wall{test::room()[3]};
  EXPECT_TRUE(up_of_first({}, one_wall).isZero());
  const Vector3OrAuto given = std::array<double, 3>{0.0, -1.0, -0.5};
  EXPECT_LT((up_of_first(given, one_wall) - Eigen::Vector3d{0, -1, -0.5}.normalized()).norm(),
            1e-3);
}

TEST(MapletBuilder, PlanarMotionStaysInItsPlane) {
  Walk walk;
  const Eigen::Vector3d up{0.0, -1.0, 0.0};
  walk.builder().hold_to(PlanarMotion{up});
  std::mt19937 rng{5};
  for (int i = 0; i < 14; ++i) {
    const Se3 T = camera(1.5 + 0.15 * i, 2.5, 0.05 * i);
    walk.step(T * Se3::exp(test::normal_tangent(rng, 2e-3, 2e-3)));
  }
  walk.finish();
  for (const auto& kept : walk.maplets) {
    for (const MapletKeyframe& k : kept.maplet->keyframes) {
      EXPECT_NEAR(k.T_maplet_camera.se3.t.y(), 0.0, codec::kMaxTranslationError_m);
      EXPECT_LT((k.T_maplet_camera.se3.q * up - up).norm(), 2 * codec::kMaxRotationError_rad);
    }
    if (!kept.link.valid) continue;
    EXPECT_NEAR(kept.link.T_previous_this.se3.t.y(), 0.0, 1e-9);
  }
}

TEST(MapletBuilder, SaysWhatShareOfThePointsItHolds) {
  Walk walk;
  walk.step(camera(1.5, 2.5, 0.0));
  // The first keyframe does not count its pixels; the second says that half of its are on no patch.
  Keyframe& k = walk.keyframe();
  std::uint64_t points = 0;
  for (const Patch& p : k.patches.patches) points += p.pixels;
  k.patches.valid_pixels = static_cast<std::uint32_t>(2 * points);
  k.stamp += Stamp{1};
  EXPECT_EQ(walk.builder().add(k, nullptr, Deadline::never()), nullptr);
  walk.finish();
  const PointShare share = walk.maplets.at(0).points;
  EXPECT_EQ(share.seen, 2 * points);
  EXPECT_GT(static_cast<double>(share.kept), 1.9 * static_cast<double>(points));
}

// A patch that no plane took is kept as a small quad where it is large enough.
TEST(MapletBuilder, LoosePatchesAreKeptAsQuadsWhereTheyAreWorthIt) {
  const auto quads = [](double depth_m) {
    Walk walk{{}, {}};
    Keyframe& k = walk.keyframe();
    k.patches.camera = {320, 240, 262.0, 262.0, 159.5, 119.5};
    Patch p{};
    p.theta = {0.0, 0.0, 1.0 / depth_m};
    p.information = 1e6 * Eigen::Matrix3d::Identity();
    p.ray = {0.0, 0.0};
    p.u_px = 140;
    p.v_px = 100;
    p.width_px = p.height_px = 32;
    p.pixels = 32 * 32;
    p.plane = Patch::kNoPlane;
    k.patches.patches.push_back(p);
    k.patches.cells.cell_px = 64;
    k.patches.cells.width = 5;
    k.patches.cells.height = 4;
    k.patches.cells.patch.fill(0);
    k.patches.valid_pixels = p.pixels;
    EXPECT_EQ(walk.builder().add(k, nullptr, Deadline::never()), nullptr);
    walk.finish();
    EXPECT_EQ(walk.counts().quads_kept + walk.counts().quads_left_out, 1U);
    return walk.maplets.at(0).maplet->planes.size();
  };
  EXPECT_EQ(quads(2.0), 1U);  // 24 cm
  EXPECT_EQ(quads(0.5), 0U);  // 6 cm
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
