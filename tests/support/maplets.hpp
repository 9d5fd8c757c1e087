// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <random>

#include "core/maplet/maplet.hpp"

namespace maplet::test {

/// A rectangle of surface: its centre, half sides along two axes, the seen side.
struct Wall {
  Eigen::Vector3d centre;
  Eigen::Vector3d half_a, half_b;  ///< n = a x b
  [[nodiscard]] Eigen::Vector3d normal() const { return half_a.cross(half_b).normalized(); }
};

/// Adds a wall, seen from the maplet's frame, to a maplet.
inline void add_wall(Maplet& m, const Wall& wall, const Se3& T_maplet_world,
                     const Eigen::Vector3d& sigma = {1e-3, 1e-3, 2e-3}) {
  MapletPlane p;
  p.id = static_cast<std::uint8_t>(m.planes.size());
  p.observations = 5;
  p.mean_gray = 100.0F;
  p.plane.n = T_maplet_world.q * wall.normal();
  p.plane.d = -p.plane.n.dot(T_maplet_world * wall.centre);
  p.covariance = sigma.cwiseAbs2().asDiagonal();
  p.grid.axis = PlaneBasis::best_axis(p.plane.n);
  const double size = m.cell_m_of(p.grid);
  Eigen::Array2d low = Eigen::Array2d::Constant(1e9);
  Eigen::Array2d high = -low;
  for (const double a : {-1.0, 1.0}) {
    for (const double b : {-1.0, 1.0}) {
      const Eigen::Array2d at =
          p.basis()
              .coordinates(T_maplet_world * (wall.centre + a * wall.half_a + b * wall.half_b))
              .array() /
          size;
      low = low.min(at);
      high = high.max(at);
    }
  }
  p.grid.column0 = static_cast<std::int16_t>(std::floor(low.x()));
  p.grid.row0 = static_cast<std::int16_t>(std::floor(low.y()));
  p.grid.columns = static_cast<std::uint16_t>(std::ceil(high.x()) - p.grid.column0);
  p.grid.rows = static_cast<std::uint16_t>(std::ceil(high.y()) - p.grid.row0);
  if (!m.take_cells(p.grid)) return;
  const Se3 T_world_maplet = T_maplet_world.inverse();
  for (int row = 0; row < p.grid.rows; ++row) {
    for (int column = 0; column < p.grid.columns; ++column) {
      const Eigen::Vector3d at =
          T_world_maplet * p.basis().point((p.grid.column0 + column + 0.5) * size,
                                           (p.grid.row0 + row + 0.5) * size) -
          wall.centre;
      if (std::abs(at.dot(wall.half_a)) <= wall.half_a.squaredNorm() &&
          std::abs(at.dot(wall.half_b)) <= wall.half_b.squaredNorm()) {
        m.set_cell(p.grid, column, row);
      }
    }
  }
  m.measure_extent(p);
  m.planes.push_back(p);
}

/// A room of 6 x 5 x 2.6 m with a cupboard and a table; world z up, origin at a floor corner.
inline std::vector<Wall> room() {
  using V = Eigen::Vector3d;
  return {
      {V{3, 2.5, 0}, V{3, 0, 0}, V{0, 2.5, 0}},         // floor, n = +z
      {V{3, 2.5, 2.6}, V{0, 2.5, 0}, V{3, 0, 0}},       // ceiling, n = -z
      {V{0, 2.5, 1.3}, V{0, 2.5, 0}, V{0, 0, 1.3}},     // n = +x
      {V{6, 2.5, 1.3}, V{0, 0, 1.3}, V{0, 2.5, 0}},     // n = -x
      {V{3, 0, 1.3}, V{0, 0, 1.3}, V{3, 0, 0}},         // n = +y
      {V{3, 5, 1.3}, V{3, 0, 0}, V{0, 0, 1.3}},         // n = -y
      {V{0.6, 1.2, 1.0}, V{0, 0.8, 0}, V{0, 0, 1.0}},   // cupboard front, n = +x
      {V{4.2, 2.0, 0.75}, V{0.7, 0, 0}, V{0, 0.4, 0}},  // table top, n = +z
      {V{4.2, 1.6, 0.4}, V{0, 0, 0.35}, V{0.7, 0, 0}},  // table side, n = +y
  };
}

/// Camera at p, looking along the heading (rad, about world z): z forward, x right, y down.
inline Se3 camera_at(const Eigen::Vector3d& p, double heading_rad) {
  Eigen::Matrix3d r;
  const double c = std::cos(heading_rad);
  const double s = std::sin(heading_rad);
  r.col(0) = Eigen::Vector3d{s, -c, 0.0};
  r.col(1) = Eigen::Vector3d{0.0, 0.0, -1.0};
  r.col(2) = Eigen::Vector3d{c, s, 0.0};
  return {Eigen::Quaterniond{r}, p};
}

/// What a maplet of `walls` at T_world_maplet holds when everything is seen exactly.
inline void fill(Maplet& m, const std::vector<Wall>& walls, const Se3& T_world_maplet) {
  m.clear();
  m.keyframes.push_back({});
  for (const Wall& wall : walls) add_wall(m, wall, T_world_maplet.inverse());
}

inline Vector6d normal_tangent(std::mt19937& rng, double sigma_m, double sigma_rad) {
  std::normal_distribution<double> normal;
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi[i] = normal(rng) * (i < 3 ? sigma_m : sigma_rad);
  return xi;
}

}  // namespace maplet::test
