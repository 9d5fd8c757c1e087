// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "tools/draw/canvas.hpp"
#include "tools/draw/plan.hpp"

namespace maplet::draw {

/// From the plan's metres to the page's pixels.
struct Projection {
  Eigen::Vector2d origin_px = Eigen::Vector2d::Zero();  ///< of the plan's (0, 0)
  double px_per_m = 1.0;

  [[nodiscard]] Eigen::Vector2d operator()(const Eigen::Vector2d& p_m) const {
    return origin_px + px_per_m * Eigen::Vector2d{p_m.x(), -p_m.y()};
  }
  [[nodiscard]] Polyline operator()(const Polyline& line_m) const;
};

// The map's layers, from the bottom up.
void draw_floor(Canvas& canvas, const Projection& project, const Plan& plan);
void draw_walls(Canvas& canvas, const Projection& project, const Plan& plan);
void draw_paths(Canvas& canvas, const Projection& project, const Plan& plan);
void draw_skeleton(Canvas& canvas, const Projection& project, const Plan& plan);

/// How wide paths are at this scale; the legend's samples are drawn with the same.
struct LineWidths {
  double path_px, thin_px;
};
[[nodiscard]] LineWidths widths_at(double px_per_m);

/// Of a maplet's origin.
inline constexpr double kOriginRadius_px = 11.0;
void draw_origin(Canvas& canvas, const Eigen::Vector2d& at_px, std::string_view number,
                 Colour colour);

}  // namespace maplet::draw
