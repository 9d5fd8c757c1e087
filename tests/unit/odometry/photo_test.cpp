// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Intensities beside patches: a painted wall, along which depth sees nothing.
#include <gtest/gtest.h>

#include <vector>

#include "tests/support/track_session.hpp"

namespace maplet {
namespace {

using test::PatchScene;
using test::TrackSession;

constexpr double kWallM = 2.0;
const CameraModel kDepthCamera{320, 240, 285.0, 285.0, 159.5, 119.5};

double paint(double x, double y) {
  return 128.0 + 35.0 * std::sin(23.0 * x + 5.0 * y) + 30.0 * std::sin(17.0 * y - 9.0 * x) +
         25.0 * std::sin(41.0 * x) * std::sin(37.0 * y);
}

// A wall at z = 2 with a picture on it, seen by a depth camera and, where it is another one, a gray
// camera.
struct PaintedWall {
  PatchScene scene;
  std::vector<std::uint16_t> depth;
  std::vector<std::uint8_t> gray;

  PaintedWall() {
    scene.camera = kDepthCamera;
    scene.cell_px = 20;
    scene.rectangles = {{{0, 0, kWallM}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 9, 9}};
  }
  // gain and offset: exposure
  void paint_gray(const Se3& T_world_gray, const CameraModel& camera, double gain, double offset) {
    gray.clear();
    for (int v = 0; v < camera.height_px; ++v) {
      for (int u = 0; u < camera.width_px; ++u) {
        const Eigen::Vector3d ray = T_world_gray.q * camera.ray(u, v);
        const Eigen::Vector3d at = T_world_gray.t + ray * ((kWallM - T_world_gray.t.z()) / ray.z());
        gray.push_back(static_cast<std::uint8_t>(
            std::clamp(gain * paint(at.x(), at.y()) + offset, 0.0, 255.0)));
      }
    }
  }
  void measure(const Se3& T_world_camera) {
    depth.clear();
    for (int v = 0; v < kDepthCamera.height_px; ++v) {
      for (int u = 0; u < kDepthCamera.width_px; ++u) {
        const Eigen::Vector3d ray = T_world_camera.q * kDepthCamera.ray(u, v);
        depth.push_back(static_cast<std::uint16_t>(
            std::lround(1000.0 * (kWallM - T_world_camera.t.z()) / ray.z())));
      }
    }
  }
  void dress(DepthFrame& frame) {
    frame.camera = kDepthCamera;
    frame.depth = {depth.data(), kDepthCamera.width_px, kDepthCamera.height_px,
                   kDepthCamera.width_px};
  }
};

// Sideways, down and turning about the wall's normal.
Se3 sliding(int i) {
  Vector6d xi = Vector6d::Zero();
  xi[0] = 0.004 * i;
  xi[1] = 0.05 * std::sin(0.08 * i);
  xi[5] = 0.05 * std::sin(0.1 * i);
  return Se3::exp(xi);
}

struct Exposure {
  double gain = 1.0;
  double offset = 0.0;
};

// From the fifteenth frame on the gray image is exposed otherwise.
void follow(const Se3& T_depth_gray, const CameraModel& gray_camera, const Exposure& later) {
  PaintedWall wall;
  TrackSession session;
  const bool beside = gray_camera.width_px != kDepthCamera.width_px;
  for (int i = 0; i < 40; ++i) {
    const Se3 truth = sliding(i);
    const Exposure exposure = i >= 15 ? later : Exposure{};
    wall.measure(truth);
    wall.paint_gray(truth * T_depth_gray, gray_camera, exposure.gain, exposure.offset);
    wall.dress(session.frame);
    const ImageView<std::uint8_t> gray{wall.gray.data(), gray_camera.width_px,
                                       gray_camera.height_px, gray_camera.width_px};
    session.frame.gray = beside ? ImageView<std::uint8_t>{} : gray;
    session.frame.gray_beside = {};
    if (beside) session.frame.gray_beside = {gray, gray_camera, T_depth_gray};
    const Track track = session.step(wall.scene, truth);
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    const Se3 error = truth.inverse() * track.T_odom_camera.se3;
    ASSERT_LT(error.t.norm(), 0.006) << i;
    ASSERT_LT(error.angle(), 0.004) << i;
    EXPECT_TRUE(i == 0 || track.free_axes.empty()) << i;
  }
  EXPECT_GT(session.tracker->counters().with_gray, 35u);
}

TEST(Photo, FollowsAMotionThatDepthCannotSee) { follow(Se3{}, kDepthCamera, {}); }

TEST(Photo, FollowsWhenTheExposureJumps) { follow(Se3{}, kDepthCamera, {0.6, 15.0}); }

TEST(Photo, FollowsWhenLittleContrastIsLeft) { follow(Se3{}, kDepthCamera, {0.12, 5.0}); }

TEST(Photo, TakesAGrayCameraOfItsOwn) {
  Vector6d xi;
  xi << 0.025, 0.002, 0.001, 0.01, -0.02, 0.005;
  follow(Se3::exp(xi), CameraModel{400, 300, 330.0, 332.0, 201.0, 148.0}, {});
}

// The gray camera hangs, depth goes on: nothing says how far along the wall.
TEST(Photo, LeavesOutAnImageThatIsTheOneBefore) {
  PaintedWall wall;
  TrackSession session;
  Track track;
  for (int i = 0; i < 40; ++i) {
    wall.measure(sliding(i));
    if (i < 20) wall.paint_gray(sliding(i), kDepthCamera, 1.0, 0.0);
    wall.dress(session.frame);
    session.frame.gray = {wall.gray.data(), kDepthCamera.width_px, kDepthCamera.height_px,
                          kDepthCamera.width_px};
    track = session.step(wall.scene, sliding(i));
  }
  EXPECT_EQ(session.tracker->counters().with_gray, 19u);
  EXPECT_FALSE(track.free_axes.empty());
  const double off = (sliding(39).inverse() * track.T_odom_camera.se3).t.norm();
  EXPECT_LT(off, 3.0 * std::sqrt(track.covariance.topLeftCorner<3, 3>().trace()) + 0.05);
}

// A second start is tried by patches alone; where it is refused, the first one's gray still counts.
TEST(Photo, CountsInAFrameWhoseSecondStartWasRefused) {
  PaintedWall wall;
  TrackSession session;
  Track track;
  for (int i = 0; i < 12; ++i) {
    wall.measure(sliding(i));
    wall.paint_gray(sliding(i), kDepthCamera, 1.0, 0.0);
    wall.dress(session.frame);
    session.frame.gray = {wall.gray.data(), kDepthCamera.width_px, kDepthCamera.height_px,
                          kDepthCamera.width_px};
    session.frame.motion.has_pose = true;
    session.frame.motion.T_external_camera =
        sliding(i) * Se3::exp((i == 11 ? 0.3 : 0.0) * Vector6d::Unit(3));
    track = session.step(wall.scene, sliding(i));
  }
  EXPECT_GE(session.tracker->counters().hints_refused, 1u);
  EXPECT_TRUE(track.gray);
  EXPECT_EQ(session.tracker->counters().with_gray, 11u);
}

TEST(Photo, IsOffWhereTheConfigurationSaysSo) {
  OdometryConfig config;
  config.gray = false;
  PaintedWall wall;
  TrackSession session{config};
  Track track;
  for (int i = 0; i < 5; ++i) {
    wall.measure(sliding(i));
    wall.paint_gray(sliding(i), kDepthCamera, 1.0, 0.0);
    wall.dress(session.frame);
    session.frame.gray = {wall.gray.data(), kDepthCamera.width_px, kDepthCamera.height_px,
                          kDepthCamera.width_px};
    track = session.step(wall.scene, sliding(i));
  }
  EXPECT_EQ(session.tracker->counters().with_gray, 0u);
  EXPECT_EQ(track.free_axes.size(), 3u);
}

TEST(Photo, AnImageOfTheWrongSizeIsNoImage) {
  PaintedWall wall;
  TrackSession session;
  for (int i = 0; i < 3; ++i) {
    wall.measure(sliding(i));
    wall.paint_gray(sliding(i), kDepthCamera, 1.0, 0.0);
    wall.dress(session.frame);
    session.frame.gray = {wall.gray.data(), 160, 120, 160};
    EXPECT_EQ(session.step(wall.scene, sliding(i)).state, Track::State::kTracking);
  }
  EXPECT_EQ(session.tracker->counters().with_gray, 0u);
}

}  // namespace
}  // namespace maplet
