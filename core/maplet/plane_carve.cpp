// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Cells that keyframes saw through the plane as it is in the end.
#include <array>

#include "core/maplet/plane_map.hpp"
#include "core/maplet/plane_view.hpp"

namespace maplet {

// A keyframe's look at one plane: where the middle of its grid's first quarter of a cell is, and
// the steps from one quarter to the next.
struct PlaneMap::GridLook {
  GridLook(const KeyframeLook& keyframe, const PlaneBasis& basis, const CellGrid& grid,
           double size_m, double fit_m) noexcept
      : look{*keyframe.depth, fit_m} {
    const Se3 T_camera_maplet = keyframe.T_maplet_camera.inverse();
    u = look.pixels(T_camera_maplet.q * basis.u * (0.5 * size_m));
    v = look.pixels(T_camera_maplet.q * basis.v * (0.5 * size_m));
    corner = look.pixels(T_camera_maplet * basis.point(grid.column0 * size_m, grid.row0 * size_m)) +
             0.5F * (u + v);
  }

  DepthLook look;
  Eigen::Vector3f u, v, corner;
};

// A line of quarters: every second one belongs to the same cell.
void PlaneMap::look_along(const GridLook& view, int line, const Maplet& out, const CellGrid& grid,
                          std::span<CellLooks> cells) const noexcept {
  const Eigen::Vector3f start = view.corner + static_cast<float>(line) * view.v;
  const auto [first, last] = view.look.in_view(start, view.u, 2 * grid.columns);
  for (int k = first; k < last; ++k) {
    if (!out.cell(grid, k / 2, line / 2)) continue;
    cells[static_cast<std::size_t>(k / 2)].count(
        view.look.at(start + static_cast<float>(k) * view.u));
  }
}

// Each cell is looked at in its four quarters through all keyframes, as in eq. 6.
void PlaneMap::carve(std::span<const KeyframeLook> looks, Maplet& out,
                     const MapletPlane& plane) noexcept {
  const CellGrid& grid = plane.grid;
  StaticVector<GridLook, kMaxMapletKeyframes> views;
  for (const KeyframeLook& look : looks) {
    if (plane.plane.distance(look.T_maplet_camera.t) < kBehindPlane_m || full(views)) continue;
    views.push_back({look, plane.basis(), grid, out.cell_m_of(grid), config_.fit_m});
  }
  std::array<CellLooks, kMaxGridCells> cells;
  for (int row = 0; row < grid.rows; ++row) {
    cells.fill({});
    for (const GridLook& view : views) {
      look_along(view, 2 * row, out, grid, cells);
      look_along(view, 2 * row + 1, out, grid, cells);
    }
    for (int column = 0; column < grid.columns; ++column) {
      if (!out.cell(grid, column, row)) continue;
      const CellLooks& cell = cells[static_cast<std::size_t>(column)];
      if (is_surface(cell.surface, cell.through, config_.max_free_share)) continue;
      out.clear_cell(grid, column, row);
      ++counts_.cells_carved;
    }
  }
}

}  // namespace maplet
