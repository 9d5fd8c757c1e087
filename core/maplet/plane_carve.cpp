// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Cells that keyframes saw through the plane as it is in the end.
#include <array>

#include "core/maplet/plane_map.hpp"
#include "core/maplet/plane_view.hpp"

namespace maplet {

namespace {

constexpr float kNearest_m = 0.4F;
constexpr int kLarge = 1024;  // cells

// A camera as a look through a depth image needs it: pixels from the corner of the first one.
struct Window {
  explicit Window(const CameraModel& c) noexcept
      : fx{static_cast<float>(c.fx_px)},
        fy{static_cast<float>(c.fy_px)},
        cx{static_cast<float>(c.cx_px + 0.5)},
        cy{static_cast<float>(c.cy_px + 0.5)},
        width{static_cast<float>(c.width_px)},
        height{static_cast<float>(c.height_px)} {}

  // On which sides of the view a point is, one bit each: two points that have one in common have
  // nothing of the line between them in view.
  [[nodiscard]] unsigned outside(const Eigen::Vector3f& p) const noexcept {
    const float x = fx * p.x() + cx * p.z();
    const float y = fy * p.y() + cy * p.z();
    return (p.z() < kNearest_m ? 1U : 0U) | (x < 0.0F ? 2U : 0U) | (y < 0.0F ? 4U : 0U) |
           (x >= width * p.z() ? 8U : 0U) | (y >= height * p.z() ? 16U : 0U);
  }

  float fx, fy, cx, cy, width, height;
};

}  // namespace

// A keyframe's look at one plane: where the middle of its grid's first quarter of a cell is, and
// the steps from one quarter to the next.
struct PlaneMap::GridLook {
  GridLook(const KeyframeLook& look, const PlaneBasis& basis, const CellGrid& grid,
           double size_m) noexcept
      : depth{look.depth}, window{look.depth->camera} {
    const Se3 T_camera_maplet = look.T_maplet_camera.inverse();
    u = (T_camera_maplet.q * basis.u * (0.5 * size_m)).cast<float>();
    v = (T_camera_maplet.q * basis.v * (0.5 * size_m)).cast<float>();
    corner =
        (T_camera_maplet * basis.point(grid.column0 * size_m, grid.row0 * size_m)).cast<float>() +
        0.5F * (u + v);
    across = static_cast<float>(2 * grid.columns - 1) * u;
  }

  [[nodiscard]] bool in_view(const CellGrid& grid) const noexcept {
    const Eigen::Vector3f last = corner + static_cast<float>(2 * grid.rows - 1) * v;
    return (window.outside(corner) & window.outside(corner + across) & window.outside(last) &
            window.outside(last + across)) == 0;
  }

  const DepthThumb* depth;
  Window window;
  Eigen::Vector3f u, v, corner, across;
};

// A line of quarters: every second one belongs to the same cell.
void PlaneMap::look_along(const GridLook& look, int line, const Maplet& out, const CellGrid& grid,
                          std::span<CellLooks> cells) const noexcept {
  const Window& window = look.window;
  const Eigen::Vector3f start = look.corner + static_cast<float>(line) * look.v;
  if ((window.outside(start) & window.outside(start + look.across)) != 0) return;
  for (int column = 0; column < grid.columns; ++column) {
    if (!out.cell(grid, column, line / 2)) continue;
    for (int half = 0; half < 2; ++half) {
      const Eigen::Vector3f p = start + static_cast<float>(2 * column + half) * look.u;
      if (p.z() < kNearest_m) continue;
      const float inverse = 1.0F / p.z();
      const float x = window.fx * p.x() * inverse + window.cx;
      const float y = window.fy * p.y() * inverse + window.cy;
      if (!(x >= 0.0F && y >= 0.0F && x < window.width && y < window.height)) continue;
      const float z_m = look.depth->at(x, y);
      if (z_m <= 0.0F) continue;
      const float off_m = z_m - p.z();
      const auto limit_m = static_cast<float>(behind_m(config_.fit_m, p.z()));
      CellLooks& cell = cells[static_cast<std::size_t>(column)];
      if (off_m > limit_m) {
        ++cell.through;
      } else if (off_m >= -limit_m) {
        ++cell.on;
      }
    }
  }
}

// Each cell is looked at in its four quarters through all keyframes, as in eq. 6.
void PlaneMap::carve(std::span<const KeyframeLook> looks, Maplet& out,
                     const MapletPlane& plane) noexcept {
  const CellGrid& grid = plane.grid;
  StaticVector<GridLook, kMaxMapletKeyframes> views;
  for (const KeyframeLook& look : looks) {
    if (plane.plane.distance(look.T_maplet_camera.t) < kBehindPlane_m || full(views)) continue;
    const GridLook view{look, plane.basis(), grid, out.cell_m_of(grid)};
    if (view.in_view(grid)) views.push_back(view);
  }
  // Of large planes the upper quarters in one keyframe, the lower ones in the next.
  const bool alternate = grid.columns * grid.rows > kLarge;
  std::array<CellLooks, kMaxGridCells> cells;
  for (int row = 0; row < grid.rows; ++row) {
    cells.fill({0, 0});
    for (std::size_t i = 0; i < views.size(); ++i) {
      for (int lower = 0; lower < 2; ++lower) {
        if (alternate && lower == static_cast<int>(i % 2)) continue;
        look_along(views[i], 2 * row + lower, out, grid, cells);
      }
    }
    for (int column = 0; column < grid.columns; ++column) {
      const CellLooks& cell = cells[static_cast<std::size_t>(column)];
      if (cell.through <= config_.max_free_share * (cell.on + cell.through)) continue;
      out.clear_cell(grid, column, row);
      ++counts_.cells_carved;
    }
  }
}

}  // namespace maplet
