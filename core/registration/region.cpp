// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/region.hpp"

#include <array>
#include <cmath>
#include <numbers>

namespace maplet {

namespace {

constexpr double kBeside_m = 0.06;  // of a plane that goes on where another one ends

// Whether any surface but `self` is at p.
bool mapped(const Maplet& m, const MapletPlane& self, const Eigen::Vector3d& p) noexcept {
  for (const MapletPlane& plane : m.planes) {
    if (&plane == &self || std::abs(plane.plane.distance(p)) > kBeside_m) continue;
    if (m.covers(plane, p)) return true;
  }
  return false;
}

// Calls f(point beyond the border) for border cells of a plane that end in the open.
template <class F>
void for_open_borders(const Maplet& m, const MapletPlane& plane, F f) noexcept {
  constexpr int kBeside[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  const CellGrid& grid = plane.grid;
  const PlaneBasis basis = plane.basis();
  const double size = m.cell_m_of(grid);
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      if (!m.cell(grid, column, row)) continue;
      for (const auto& [dc, dr] : kBeside) {
        const int c = column + dc;
        const int r = row + dr;
        const bool inside = c >= 0 && r >= 0 && c < grid.columns && r < grid.rows;
        if (inside && m.cell(grid, c, r)) continue;
        const Eigen::Vector3d p =
            basis.point((grid.column0 + c + 0.5) * size, (grid.row0 + r + 0.5) * size);
        const Eigen::Vector3d here =
            basis.point((grid.column0 + column + 0.5) * size, (grid.row0 + row + 0.5) * size);
        // An edge of two surfaces, from outside or inside.
        if (mapped(m, plane, p) || mapped(m, plane, here) ||
            mapped(m, plane, here + 0.5 * size * plane.plane.n)) {
          continue;
        }
        f(p);
        break;
      }
    }
  }
}

}  // namespace

bool RegionOfInterest::contains(const Eigen::Vector3d& p) const noexcept {
  const Eigen::Vector2d at = plan(p);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d side = corners[(i + 1) % corners.size()] - corners[i];
    const Eigen::Vector2d to = at - corners[i];
    if (side.x() * to.y() - side.y() * to.x() < 0.0) return false;
  }
  return true;
}

bool RegionOfInterest::touches(const Maplet& maplet, const MapletPlane& plane,
                               const Se3& T) const noexcept {
  if (corners.empty() || contains(T * plane.centre)) return true;
  const PlaneBasis basis = plane.basis();
  const double size = maplet.cell_m_of(plane.grid);
  for (const int right : {0, 1}) {
    for (const int bottom : {0, 1}) {
      const Eigen::Vector3d corner =
          basis.point((plane.grid.column0 + right * plane.grid.columns) * size,
                      (plane.grid.row0 + bottom * plane.grid.rows) * size);
      if (contains(T * corner)) return true;
    }
  }
  return false;
}

Eigen::Vector3d up_of(const Maplet& maplet) noexcept {
  if (!maplet.up.isZero()) return maplet.up;
  return maplet.planes.empty() ? Eigen::Vector3d{0.0, -1.0, 0.0} : maplet.planes[0].plane.n;
}

Frontier find_frontier(const Maplet& maplet, const Eigen::Vector3d& up) noexcept {
  Frontier out;
  Eigen::Index flattest = 0;
  up.cwiseAbs().minCoeff(&flattest);
  out.region.x = up.cross(Eigen::Vector3d::Unit(flattest)).normalized();
  out.region.y = up.cross(out.region.x);
  // Support points in sixteen directions: their half planes make a convex polygon, eq. 19.
  std::array<double, RegionOfInterest::kCorners> reach;
  reach.fill(-1e9);
  std::array<Eigen::Vector2d, RegionOfInterest::kCorners> direction;
  for (std::size_t i = 0; i < RegionOfInterest::kCorners; ++i) {
    const double angle =
        2.0 * std::numbers::pi * static_cast<double>(i) / RegionOfInterest::kCorners;
    direction[i] = {std::cos(angle), std::sin(angle)};
  }
  for (const MapletPlane& plane : maplet.planes) {
    for_open_borders(maplet, plane, [&](const Eigen::Vector3d& p) {
      ++out.cells;
      const Eigen::Vector2d at = out.region.plan(p);
      for (std::size_t i = 0; i < RegionOfInterest::kCorners; ++i) {
        reach[i] = std::max(reach[i], direction[i].dot(at));
      }
    });
  }
  if (out.cells == 0) return out;
  for (std::size_t i = 0; i < RegionOfInterest::kCorners; ++i) {
    const std::size_t next = (i + 1) % RegionOfInterest::kCorners;
    const double a = reach[i] + Frontier::kMargin_m;
    const double b = reach[next] + Frontier::kMargin_m;
    const Eigen::Vector2d& u = direction[i];
    const Eigen::Vector2d& v = direction[next];
    const double determinant = u.x() * v.y() - u.y() * v.x();
    out.region.corners.push_back(
        {(a * v.y() - b * u.y()) / determinant, (b * u.x() - a * v.x()) / determinant});
  }
  return out;
}

}  // namespace maplet
