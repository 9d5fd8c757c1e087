// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/layers.hpp"

#include <algorithm>

#include "tools/draw/palette.hpp"

namespace maplet::draw {
namespace {

using Eigen::Vector2d;

constexpr double kCasing_px = 3.0;
constexpr double kDotRadius_px = 4.5;

[[nodiscard]] std::vector<Polyline> projected(const Projection& project,
                                              const std::vector<Polyline>& lines) {
  std::vector<Polyline> out;
  for (const Polyline& line : lines) out.push_back(project(line));
  return out;
}

}  // namespace

Polyline Projection::operator()(const Polyline& line_m) const {
  Polyline out;
  out.reserve(line_m.size());
  for (const Vector2d& p : line_m) out.push_back((*this)(p));
  return out;
}

LineWidths widths_at(double px_per_m) { return {std::clamp(0.045 * px_per_m, 3.0, 5.0), 1.6}; }

void draw_floor(Canvas& canvas, const Projection& project, const Plan& plan) {
  canvas.fill(projected(project, plan.floor), kFloor);
  const auto tops = projected(project, plan.tops);
  canvas.fill(tops, kTops);
  for (const Polyline& line : tops) canvas.stroke_outline(line, {1.0, kTopsEdge});
}

void draw_walls(Canvas& canvas, const Projection& project, const Plan& plan) {
  for (std::size_t i = 0; i < plan.walls.size(); ++i) {
    canvas.fill(projected(project, plan.walls[i]), kWalls[i]);
  }
}

void draw_paths(Canvas& canvas, const Projection& project, const Plan& plan) {
  const LineWidths widths = widths_at(project.px_per_m);
  for (const AgentPlan& agent : plan.agents) {
    for (const Polyline& line : agent.odometry) {
      canvas.stroke(project(line), {widths.thin_px + 0.8, kOdometry});
    }
  }
  for (std::size_t i = 0; i < plan.agents.size(); ++i) {
    for (const Polyline& line : plan.agents[i].trajectory) {
      const Polyline px = project(line);
      canvas.stroke(px, {widths.path_px + kCasing_px, kPaper});
      canvas.stroke(px, {widths.path_px, agent_colour(i)});
    }
  }
}

void draw_origin(Canvas& canvas, const Vector2d& at_px, std::string_view number, Colour colour) {
  canvas.disc(at_px, kOriginRadius_px + 1.5, kPaper);
  canvas.disc(at_px, kOriginRadius_px, colour);
  const double size_px = number.size() < 3 ? 13.0 : 10.0;
  canvas.text(at_px + Vector2d{0.0, 0.36 * size_px}, number,
              {size_px, Weight::kBold, kPaper, Align::kCentre});
}

void draw_skeleton(Canvas& canvas, const Projection& project, const Plan& plan) {
  const LineWidths widths = widths_at(project.px_per_m);
  for (const bool closure : {false, true}) {
    for (const AgentPlan& agent : plan.agents) {
      for (const AgentPlan::Edge& edge : agent.edges) {
        if (edge.closure != closure) continue;
        const Polyline line{project(edge.from), project(edge.to)};
        if (closure) canvas.stroke(line, {widths.thin_px + 3.4, kPaper});
        canvas.stroke(
            line, closure ? Pen{widths.thin_px + 0.8, kClosure, 6.0} : Pen{widths.thin_px, kInk});
      }
    }
  }
  // A number where there is room for it, a dot where there is not; the first maplet is on top.
  std::vector<Vector2d> numbered;
  for (std::size_t i = 0; i < plan.agents.size(); ++i) {
    for (const AgentPlan::Origin& origin : plan.agents[i].origins) {
      const Vector2d at_px = project(origin.at);
      const bool room = std::ranges::all_of(numbered, [&](const Vector2d& other) {
        return (other - at_px).norm() > 2.0 * kOriginRadius_px + 2.0;
      });
      if (room) {
        numbered.push_back(at_px);
        continue;
      }
      canvas.disc(at_px, kDotRadius_px + 1.2, kPaper);
      canvas.disc(at_px, kDotRadius_px, agent_colour(i));
    }
  }
  std::size_t next = 0;
  for (std::size_t i = 0; i < plan.agents.size(); ++i) {
    for (const AgentPlan::Origin& origin : plan.agents[i].origins) {
      if (next == numbered.size() || numbered[next] != project(origin.at)) continue;
      draw_origin(canvas, numbered[next++], std::to_string(origin.id), agent_colour(i));
    }
  }
}

}  // namespace maplet::draw
