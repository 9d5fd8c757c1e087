// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/tracker.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "tests/support/patch_scene.hpp"

namespace maplet {
namespace {

using test::PatchScene;

DepthFrame frame_at(int index) {
  DepthFrame frame;
  frame.index = static_cast<std::uint64_t>(index);
  frame.stamp = std::chrono::milliseconds{33} * index;
  return frame;
}

Se3 pose_at(double s) {
  Vector6d xi;
  xi << 0.4 * std::sin(1.3 * s), 0.1 * std::sin(2.0 * s), 0.5 * std::sin(0.7 * s),
      0.15 * std::sin(1.1 * s), 0.5 * std::sin(0.9 * s), 0.1 * std::sin(1.7 * s);
  return Se3::exp(xi);
}

// A tracker over a scene, making keyframes when they are due.
struct Session {
  explicit Session(const OdometryConfig& config = {})
      : tracker{std::make_unique<Tracker>(config, arena)}, patches{std::make_unique<PatchSet>()} {}

  Track step(const PatchScene& scene, const Se3& T_world_camera,
             Deadline deadline = Deadline::never()) {
    *patches = scene.view(T_world_camera, rng);
    return feed(deadline);
  }
  Track feed(Deadline deadline = Deadline::never()) {
    const DepthFrame frame = frame_at(index++);
    const Track track = tracker->run(frame, *patches, deadline);
    if (track.keyframe_due) {
      last_keyframe = &tracker->make_keyframe(frame, *patches, track);
      ++keyframes;
    }
    return track;
  }

  std::mt19937 rng{7};
  Arena arena;
  std::unique_ptr<Tracker> tracker;
  std::unique_ptr<PatchSet> patches;
  const Keyframe* last_keyframe = nullptr;
  int keyframes = 0;
  int index = 0;
};

TEST(Tracker, FollowsASmoothMotion) {
  const PatchScene scene = test::room();
  Session run;
  const Se3 start = pose_at(0.0);
  for (int i = 0; i < 150; ++i) {
    const Se3 truth = start.inverse() * pose_at(0.033 * i);
    const Track track = run.step(scene, pose_at(0.033 * i));
    ASSERT_EQ(track.state, Track::State::kTracking) << i;
    const Se3 error = truth.inverse() * track.T_odom_camera.se3;
    ASSERT_LT(error.t.norm(), 0.01)
        << i << " inl " << track.inliers << " it " << track.iterations << " ov " << track.overlap
        << " free " << track.free_axes.size() << " est "
        << track.T_odom_camera.se3.log().transpose() << " truth " << truth.log().transpose()
        << " sig " << track.covariance.diagonal().cwiseSqrt().transpose();
    ASSERT_LT(error.angle(), 0.005) << i;
  }
  EXPECT_GT(run.keyframes, 2);
  EXPECT_EQ(run.tracker->counters().lost, 0u);
}

}  // namespace
}  // namespace maplet
