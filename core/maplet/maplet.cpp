// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/maplet.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

PlaneBasis::PlaneBasis(const Plane& plane, int axis) noexcept
    : foot{-plane.d * plane.n},
      u{(Eigen::Vector3d::Unit(axis) - plane.n * plane.n[axis]).normalized()},
      v{plane.n.cross(u)} {}

std::uint8_t PlaneBasis::best_axis(const Eigen::Vector3d& n) noexcept {
  Eigen::Index axis = 0;
  n.cwiseAbs().minCoeff(&axis);
  return static_cast<std::uint8_t>(axis);
}

bool Maplet::covers(const MapletPlane& plane, const Eigen::Vector3d& p) const noexcept {
  const Eigen::Vector2d at = plane.basis().coordinates(p) / cell_m_of(plane.grid);
  const double column = std::floor(at.x()) - plane.grid.column0;
  const double row = std::floor(at.y()) - plane.grid.row0;
  if (!(column >= 0.0 && row >= 0.0 && column < plane.grid.columns && row < plane.grid.rows)) {
    return false;
  }
  return cell(plane.grid, static_cast<int>(column), static_cast<int>(row));
}

bool Maplet::take_cells(CellGrid& grid) noexcept {
  const std::uint32_t bits = std::uint32_t{grid.columns} * grid.rows;
  if (bits > kMaxMapletCells - cells_used) return false;
  grid.first_bit = cells_used;
  cells_used += bits;
  return true;
}

void Maplet::give_back(const CellGrid& grid) noexcept {
  for (std::uint32_t bit = grid.first_bit; bit < cells_used; ++bit) {
    cells[bit / 64] &= ~(std::uint64_t{1} << (bit % 64));
  }
  cells_used = grid.first_bit;
}

void Maplet::measure_extent(MapletPlane& plane) const noexcept {
  const PlaneBasis basis = plane.basis();
  const CellGrid& grid = plane.grid;
  std::int64_t columns = 0;
  std::int64_t rows = 0;
  std::uint32_t occupied = 0;
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      if (!cell(grid, column, row)) continue;
      ++occupied;
      columns += column;
      rows += row;
    }
  }
  const double size = cell_m_of(grid);
  plane.grid.occupied = occupied;
  plane.area_m2 = occupied * size * size;
  const double count = std::max(occupied, 1U);
  plane.centre = basis.point((static_cast<double>(columns) / count + grid.column0 + 0.5) * size,
                             (static_cast<double>(rows) / count + grid.row0 + 0.5) * size);
}

void Maplet::clear() noexcept {
  key = {};
  stamp = {};
  keyframes.clear();
  planes.clear();
  up.setZero();
  complete = true;
  cells.fill(0);
  cells_used = 0;
}

}  // namespace maplet
