// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <memory>
#include <random>

#include "core/odometry/tracker.hpp"
#include "tests/support/patch_scene.hpp"

namespace maplet::test {

/// A hand-held camera's way, s in seconds.
inline Se3 wandering(double s) {
  Vector6d xi;
  xi << 0.4 * std::sin(1.3 * s), 0.1 * std::sin(2.0 * s), 0.5 * std::sin(0.7 * s),
      0.15 * std::sin(1.1 * s), 0.5 * std::sin(0.9 * s), 0.1 * std::sin(1.7 * s);
  return Se3::exp(xi);
}

/// A tracker over a scene, making keyframes when they are due. `frame` may be dressed between
/// steps.
struct TrackSession {
  explicit TrackSession(const OdometryConfig& config = {})
      : tracker{std::make_unique<Tracker>(config, arena)}, patches{std::make_unique<PatchSet>()} {}

  Track step(const PatchScene& scene, const Se3& T_world_camera,
             Deadline deadline = Deadline::never()) {
    *patches = scene.view(T_world_camera, rng);
    return feed(deadline);
  }
  Track feed(Deadline deadline = Deadline::never()) {
    frame.index = static_cast<std::uint64_t>(index);
    frame.stamp = std::chrono::milliseconds{33} * index + stamp_offset;
    ++index;
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
  DepthFrame frame;
  Duration stamp_offset{};
  int index = 0;
};

}  // namespace maplet::test
