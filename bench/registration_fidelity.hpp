// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "bench/registration_data.hpp"
#include "drivers/open_source.hpp"

namespace maplet::bench {

/// How well maplets stand for the depth images of their keyframes.
struct Fidelity {
  std::uint64_t points = 0;  ///< valid ones nearer than 4 m, every third in u and v
  std::uint64_t near = 0;    ///< within 2 cm of a cell
  double squares_m2 = 0.0;   ///< of their distances
  std::uint64_t cells = 0;   ///< that some keyframe looked at
  std::uint64_t free = 0;    ///< of which more than 20 % of the looks went through
};

/// A keyframe's points against the decoded maplet; its cells against the depth image.
class FidelityOf {
 public:
  explicit FidelityOf(const Maplet& maplet) : maplet_{maplet} {
    for (const MapletPlane& p : maplet.planes) {
      looks_.emplace_back(std::size_t{p.grid.columns} * p.grid.rows);
    }
  }

  void add(const DepthFrame& frame, const Se3& T_maplet_camera) {
    const auto at = [&](int u, int v) { return frame.depth.at(u, v) * frame.metres_per_unit; };
    for (int v = 0; v < frame.depth.height_px; v += 3) {
      for (int u = 0; u < frame.depth.width_px; u += 3) {
        const double z = at(u, v);
        if (!(z > 0.0 && z < 4.0)) continue;
        ++out_.points;
        const double off = nearest(T_maplet_camera * (z * frame.camera.ray(u, v)));
        if (off > 0.02) continue;
        ++out_.near;
        out_.squares_m2 += off * off;
      }
    }
    const Se3 T_camera_maplet = T_maplet_camera.inverse();
    for (std::size_t i = 0; i < maplet_.planes.size(); ++i) {
      const MapletPlane& p = maplet_.planes[i];
      if (p.plane.distance(T_maplet_camera.t) < 0.05) continue;
      const PlaneBasis basis = p.basis();
      const double size = maplet_.cell_m_of(p.grid);
      for (int cell = 0; cell < p.grid.columns * p.grid.rows; ++cell) {
        const int column = cell % p.grid.columns;
        const int row = cell / p.grid.columns;
        if (!maplet_.cell(p.grid, column, row)) continue;
        for (int part = 0; part < 4; ++part) {
          const Eigen::Vector3d q =
              T_camera_maplet *
              basis.point((p.grid.column0 + column + 0.25 + 0.5 * (part & 1)) * size,
                          (p.grid.row0 + row + 0.25 + 0.5 * (part >> 1)) * size);
          if (q.z() < 0.4) continue;
          const Eigen::Vector2d px = frame.camera.project(q);
          if (!(px.x() >= 0 && px.y() >= 0 && px.x() < frame.depth.width_px - 1 &&
                px.y() < frame.depth.height_px - 1)) {
            continue;
          }
          const double z = at(static_cast<int>(px.x() + 0.5), static_cast<int>(px.y() + 0.5));
          if (!(z > 0.0)) continue;
          const double behind = 0.03 + 0.004 * q.z() * q.z();
          Looks& looks = looks_[i][static_cast<std::size_t>(cell)];
          if (z > q.z() + behind) ++looks.through;
          if (std::abs(z - q.z()) <= behind) ++looks.on;
        }
      }
    }
  }

  [[nodiscard]] Fidelity result() {
    for (const auto& plane : looks_) {
      for (const Looks& looks : plane) {
        const int all = looks.on + looks.through;
        if (all == 0) continue;
        ++out_.cells;
        out_.free += looks.through > 0.2 * all ? 1 : 0;
      }
    }
    return out_;
  }

 private:
  struct Looks {
    int on = 0;
    int through = 0;
  };

  [[nodiscard]] double nearest(const Eigen::Vector3d& p) const {
    double least = 1.0;
    for (const MapletPlane& plane : maplet_.planes) {
      const double off = std::abs(plane.plane.distance(p));
      if (off < least && off < 0.03 && maplet_.covers(plane, p)) least = off;
    }
    return least;
  }

  const Maplet& maplet_;
  std::vector<std::vector<Looks>> looks_;
  Fidelity out_;
};

/// Of all maplets of a run, over the source that it was made from.
inline Fidelity fidelity_of(const TrueRun& run) {
  SourceOptions options;
  auto source = open_source(run.source, options);
  if (!source) throw std::runtime_error{source.error().what};
  std::vector<FidelityOf> each;
  for (const TrueMaplet& m : run.maplets) each.emplace_back(*m.maplet);
  for (;;) {
    const auto frame = (*source)->next(Deadline::never());
    if (!frame) break;
    for (std::size_t i = 0; i < each.size(); ++i) {
      for (const MapletKeyframe& k : run.maplets[i].maplet->keyframes) {
        if (k.stamp == frame->stamp) each[i].add(*frame, k.T_maplet_camera.se3);
      }
    }
  }
  Fidelity sum;
  for (FidelityOf& f : each) {
    const Fidelity x = f.result();
    sum.points += x.points;
    sum.near += x.near;
    sum.squares_m2 += x.squares_m2;
    sum.cells += x.cells;
    sum.free += x.free;
  }
  return sum;
}

}  // namespace maplet::bench
