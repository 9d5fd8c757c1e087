// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/geometry/se3.hpp"
#include "tools/eval/trajectory.hpp"
#include "tools/files/surface.hpp"

namespace maplet::files {

/// Two maplets tied by a delta-pose.
struct RunEdge {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  /// Not from a maplet to the next: a place seen again.
  [[nodiscard]] bool closure() const noexcept { return a + 1 != b && b + 1 != a; }
};

struct RunMaplet {
  std::uint32_t id = 0;
  Transform<WorldFrame, MapletFrame> T_world_maplet;
  std::vector<Surface> surfaces;  ///< maplet's frame
};

/// Figures, where the folder tells them.
struct RunCounts {
  std::optional<std::uint64_t> frames;      ///< report.json
  std::optional<double> maplet_bytes;       ///< of all maplet files
  std::optional<double> point_cloud_bytes;  ///< of what they stand for: report.json
};

/// A run as its --out folder holds it. The world is the first frame's camera.
struct Run {
  std::string name;  ///< the folder's
  /// T_world_camera by tracking only, from the trajectory's first pose on; empty when there is
  /// none.
  eval::Trajectory odometry;
  eval::Trajectory trajectory;         ///< the same after the skeleton; empty when there is none
  std::map<std::uint32_t, Se3> nodes;  ///< of the skeleton: T_world_maplet
  std::vector<RunEdge> edges;
  std::vector<RunMaplet> maplets;  ///< those that the skeleton places, by id
  std::size_t unplaced = 0;        ///< maplet files that the skeleton does not place
  RunCounts counts;
};

/// Reads trajectory.tum, odometry.tum, skeleton.g2o, maplets/NNNN.maplet and report.json, whatever
/// is there of it.
/// @throws std::runtime_error  naming the file (and line), when the folder holds no skeleton and no
///   trajectory, or a file of it is damaged
[[nodiscard]] Run read_run(const std::filesystem::path& folder);

/// Run::nodes alone, empty without a skeleton.g2o.
/// @throws std::runtime_error  naming file and line, when it is damaged
[[nodiscard]] std::map<std::uint32_t, Se3> read_nodes(const std::filesystem::path& folder);

}  // namespace maplet::files
