// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/draw/contour.hpp"
#include "tools/files/run_folder.hpp"

namespace maplet::draw {

/// What a run shows from above. Page frame: x right, y to the top of the page, metres.
struct AgentPlan {
  struct Origin {
    std::uint32_t id;
    Eigen::Vector2d at;
  };
  struct Edge {
    Eigen::Vector2d from, to;
    bool closure;
  };
  std::string name;
  std::vector<Polyline> odometry;    ///< broken where tracking was lost
  std::vector<Polyline> trajectory;  ///< the same
  std::vector<Origin> origins;       ///< of maplets: the skeleton's nodes, by id
  std::vector<Edge> edges;
};

/// Figures for the title.
struct PlanCounts {
  std::size_t frames = 0;
  std::size_t maplets = 0;
  std::size_t closures = 0;
  double path_m = 0.0;
  double floor_m2 = 0.0;
  std::optional<double> maplet_bytes;       ///< when every run says it
  std::optional<double> point_cloud_bytes;  ///< the same
};

/// Upright surfaces are drawn darker where at least this much of their height was seen.
inline constexpr std::array<double, 3> kWallHeights_m{0.2, 0.7, 1.4};

/// The whole picture before it is ink.
struct Plan {
  Bounds bounds;
  std::vector<Polyline> floor;  ///< closed outlines, even-odd
  std::vector<Polyline> tops;   ///< of tables, shelves, stairs: level and above the floor
  /// Of upright surfaces, the low ones first; each lies inside the one before.
  std::array<std::vector<Polyline>, kWallHeights_m.size()> walls;
  std::vector<AgentPlan> agents;
  PlanCounts counts;
};

/// Looks at runs of one world from above.
/// @param up  in the world's axes (the first frame's camera); nothing: find_up()
/// @throws std::runtime_error  when there is nothing to draw: no pose, no maplet
[[nodiscard]] Plan make_plan(std::span<const files::Run> runs,
                             const std::optional<Eigen::Vector3d>& up);

}  // namespace maplet::draw
