// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/plan.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "tools/draw/heights.hpp"
#include "tools/draw/level.hpp"

namespace maplet::draw {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using files::Run;
using files::Surface;

constexpr double kLevelCosine = 0.94;  // 20 deg off level still counts as level
constexpr double kUprightSine = 0.5;   // 30 deg off upright still counts as upright
constexpr double kSample_m = 0.04;
constexpr double kGrid_m = 0.04;
constexpr double kFloorThickness_m = 0.25;
constexpr double kPathSimplify_m = 0.001;
constexpr double kWallGrid_m = 0.02;
constexpr double kGridsAcross = 900.0;  // walls as lines of some two pixels or more
constexpr double kMinSpeck_m = 0.15;

[[nodiscard]] bool level(const Surface& s) { return std::abs(s.plane.n.z()) > kLevelCosine; }
[[nodiscard]] bool upright(const Surface& s) { return std::abs(s.plane.n.z()) < kUprightSine; }

/// Height of a level surface, page frame.
[[nodiscard]] double height_m(const Surface& s) {
  double sum = 0.0;
  double weight = 0.0;
  for (const files::Strip& strip : s.strips) {
    const double area_m2 = strip.along.norm() * strip.across.norm();
    sum += area_m2 * (strip.corner + 0.5 * (strip.along + strip.across)).z();
    weight += area_m2;
  }
  return weight > 0.0 ? sum / weight : 0.0;
}

/// Positions along the path; a new line where the time between two poses is a gap.
[[nodiscard]] std::vector<Polyline> polylines(const eval::Trajectory& poses,
                                              const Matrix3d& R_page_world) {
  if (poses.empty()) return {};
  std::vector<Duration> spacing;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    spacing.push_back(poses[i].stamp - poses[i - 1].stamp);
  }
  Duration gap = std::chrono::milliseconds{500};
  if (!spacing.empty()) {
    const auto middle = spacing.begin() + static_cast<std::ptrdiff_t>(spacing.size() / 2);
    std::ranges::nth_element(spacing, middle);
    gap = std::max(gap, 3 * *middle);
  }
  std::vector<Polyline> lines;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (i == 0 || poses[i].stamp - poses[i - 1].stamp > gap) lines.emplace_back();
    lines.back().push_back((R_page_world * poses[i].pose.t).head<2>());
  }
  for (Polyline& line : lines) line = simplified(line, kPathSimplify_m);
  return lines;
}

[[nodiscard]] double path_m(const eval::Trajectory& poses) {
  double sum = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    sum += (poses[i].pose.t - poses[i - 1].pose.t).norm();
  }
  return sum;
}

/// The lowest height at which much of what faces upwards lies: the floor's.
[[nodiscard]] std::optional<double> floor_height_m(const std::vector<Surface>& page) {
  std::vector<std::pair<double, double>> tops;  // height, area
  double total_m2 = 0.0;
  for (const Surface& s : page) {
    if (!level(s) || s.plane.n.z() < 0.0) continue;
    tops.emplace_back(height_m(s), s.area_m2);
    total_m2 += s.area_m2;
  }
  std::ranges::sort(tops);
  for (const auto& [low_m, unused] : tops) {
    double area_m2 = 0.0;
    double sum = 0.0;
    for (const auto& [at_m, share_m2] : tops) {
      if (at_m < low_m || at_m > low_m + kFloorThickness_m) continue;
      area_m2 += share_m2;
      sum += share_m2 * at_m;
    }
    if (area_m2 > 0.1 * total_m2) return sum / area_m2;
  }
  return {};
}

/// The box of what is drawn, without the outliers of a noisy depth camera: 0.3 % at each end.
[[nodiscard]] Bounds bounds_of(const std::vector<Surface>& page,
                               const std::vector<AgentPlan>& agents) {
  std::vector<double> coordinates[2];
  for (const Surface& s : page) {
    for (const files::Strip& strip : s.strips) {
      sample(strip, 0.2, [&](const Vector3d& p) {
        coordinates[0].push_back(p.x());
        coordinates[1].push_back(p.y());
      });
    }
  }
  Bounds bounds;
  if (const std::size_t count = coordinates[0].size(); count > 0) {
    const std::size_t cut = count * 3 / 1000;
    for (auto& axis : coordinates) std::ranges::sort(axis);
    bounds.include({coordinates[0][cut], coordinates[1][cut]});
    bounds.include({coordinates[0][count - 1 - cut], coordinates[1][count - 1 - cut]});
  }
  for (const AgentPlan& agent : agents) {
    for (const auto* lines : {&agent.odometry, &agent.trajectory}) {
      for (const Polyline& line : *lines) {
        for (const Vector2d& p : line) bounds.include(p);
      }
    }
    for (const AgentPlan::Origin& origin : agent.origins) bounds.include(origin.at);
  }
  return bounds;
}

/// Outlines of the level surfaces whose height passes `wanted`.
template <class Wanted>
[[nodiscard]] std::vector<Polyline> areas(const std::vector<Surface>& page, const Bounds& bounds,
                                          double& area_m2, Wanted wanted) {
  CoverGrid grid{bounds, kGrid_m};
  for (const Surface& s : page) {
    if (!level(s) || s.plane.n.z() < 0.0 || !wanted(height_m(s))) continue;
    for (const files::Strip& strip : s.strips) {
      sample(strip, 0.6 * kSample_m, [&](const Vector3d& p) { grid.cover(p.head<2>()); });
    }
  }
  grid.smooth(0.08);
  area_m2 = grid.covered_m2();
  std::vector<Polyline> lines = grid.outlines();
  for (Polyline& line : lines) line = simplified(line, 0.012);
  return lines;
}

[[nodiscard]] bool speck(const Polyline& line) {
  Bounds box;
  for (const Vector2d& p : line) box.include(p);
  return box.size().norm() < kMinSpeck_m;
}

/// Outlines of upright surfaces, by height.
void add_walls(const std::vector<Surface>& page, Plan& plan) {
  HeightGrid grid{plan.bounds, std::max(kWallGrid_m, plan.bounds.size().maxCoeff() / kGridsAcross)};
  for (const Surface& s : page) {
    if (!upright(s)) continue;
    for (const files::Strip& strip : s.strips) {
      sample(strip, 0.7 * grid.cell_m(), [&](const Vector3d& p) { grid.add(p); });
    }
  }
  for (std::size_t i = 0; i < kWallHeights_m.size(); ++i) {
    CoverGrid cover = grid.at_least(kWallHeights_m[i]);
    cover.smooth(grid.cell_m());
    for (const Polyline& line : cover.outlines()) {
      if (!speck(line)) plan.walls[i].push_back(simplified(line, 0.15 * grid.cell_m()));
    }
  }
}

[[nodiscard]] AgentPlan agent_plan(const Run& run, const Matrix3d& R_page_world) {
  AgentPlan agent;
  agent.name = run.name;
  agent.odometry = polylines(run.odometry, R_page_world);
  agent.trajectory = polylines(run.trajectory, R_page_world);
  for (const auto& [id, T] : run.nodes) {
    agent.origins.push_back({id, (R_page_world * T.t).head<2>()});
  }
  for (const files::RunEdge& edge : run.edges) {
    const auto a = run.nodes.find(edge.a);
    const auto b = run.nodes.find(edge.b);
    if (a == run.nodes.end() || b == run.nodes.end()) continue;
    agent.edges.push_back({(R_page_world * a->second.t).head<2>(),
                           (R_page_world * b->second.t).head<2>(), edge.closure()});
  }
  return agent;
}

[[nodiscard]] PlanCounts counts_of(std::span<const Run> runs) {
  PlanCounts counts;
  counts.maplet_bytes = counts.point_cloud_bytes = 0.0;
  for (const Run& run : runs) {
    counts.frames += static_cast<std::size_t>(run.counts.frames.value_or(run.trajectory.size()));
    counts.maplets += std::max(run.maplets.size(), run.nodes.size());
    counts.closures +=
        static_cast<std::size_t>(std::ranges::count_if(run.edges, &files::RunEdge::closure));
    counts.path_m += path_m(run.trajectory);
    const auto add = [](std::optional<double>& sum, const std::optional<double>& value) {
      sum = sum && value ? std::optional{*sum + *value} : std::nullopt;
    };
    add(counts.maplet_bytes, run.counts.maplet_bytes);
    add(counts.point_cloud_bytes, run.counts.point_cloud_bytes);
  }
  return counts;
}

}  // namespace

Plan make_plan(std::span<const Run> runs, const std::optional<Vector3d>& up) {
  std::vector<Surface> world;
  for (const Run& run : runs) {
    for (const files::RunMaplet& maplet : run.maplets) {
      for (const Surface& surface : maplet.surfaces) {
        world.push_back(files::moved(maplet.T_world_maplet.se3, surface));
      }
    }
  }
  const Vector3d upwards = up ? up->normalized() : find_up(world, -Vector3d::UnitY());
  const Matrix3d R_page_world = lay_out(world, upwards, Vector3d::UnitZ());
  const Se3 T_page_world{Eigen::Quaterniond{R_page_world}, Vector3d::Zero()};

  Plan plan;
  plan.counts = counts_of(runs);
  for (const Run& run : runs) plan.agents.push_back(agent_plan(run, R_page_world));
  std::vector<Surface> page;
  page.reserve(world.size());
  for (const Surface& surface : world) page.push_back(files::moved(T_page_world, surface));
  plan.bounds = bounds_of(page, plan.agents);
  if (plan.bounds.empty()) {
    throw std::runtime_error{"nothing to draw: no pose was tracked and no maplet closed"};
  }
  add_walls(page, plan);
  if (const auto floor_m = floor_height_m(page)) {
    double tops_m2 = 0.0;
    plan.floor = areas(page, plan.bounds, plan.counts.floor_m2,
                       [&](double at_m) { return std::abs(at_m - *floor_m) < kFloorThickness_m; });
    plan.tops = areas(page, plan.bounds, tops_m2,
                      [&](double at_m) { return at_m >= *floor_m + kFloorThickness_m; });
  }
  return plan;
}

}  // namespace maplet::draw
