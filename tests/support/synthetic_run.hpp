// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "core/geometry/se3.hpp"

namespace maplet::test {

/// A rectangle in the room: corner + s a + t b, s, t in [0, 1].
struct Panel {
  Eigen::Vector3d corner, a, b;
};

/// A flat of three rooms on a corridor, 9 x 6.5 m, walls 2.4 m high, with doors and furniture. The
/// first camera's frame (z forward, x right, y down), 1.2 m above the floor; `tilt_rad` turns that
/// frame about its x axis, as a camera that looks down does.
[[nodiscard]] std::vector<Panel> flat(double tilt_rad = 0.0);

/// A walk through the flat's rooms and back to its start: T_world_camera, `count` poses.
[[nodiscard]] std::vector<Se3> walk_through_flat(int count, double tilt_rad = 0.0);

struct RunOptions {
  int frames = 600;
  int maplets = 20;
  double tilt_rad = 0.0;
};

/// Writes what `mapletd --out` writes for that walk: planes seen without noise, odometry that
/// drifts, one closure at the end.
void write_synthetic_run(const std::filesystem::path& folder, const RunOptions& options);

}  // namespace maplet::test
