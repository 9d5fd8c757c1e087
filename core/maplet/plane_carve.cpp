// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Cells that keyframes saw through the plane as it is in the end.
#include <algorithm>

#include "core/maplet/plane_map.hpp"
#include "core/maplet/plane_view.hpp"

namespace maplet {

namespace {

constexpr float kNearest_m = 0.4F;
constexpr std::size_t kLarge = 1024;  // cells

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

// Each cell is looked at in its four quarters through all keyframes, as in eq. 6.
void PlaneMap::carve(std::span<const KeyframeLook> looks, Maplet& out,
                     const MapletPlane& plane) noexcept {
  const CellGrid& grid = plane.grid;
  const auto cells = looks_.first(std::size_t{grid.columns} * grid.rows);
  std::fill(cells.begin(), cells.end(), CellLooks{0, 0});
  const PlaneBasis basis = plane.basis();
  const double size_m = out.cell_m_of(grid);
  // Of large planes the upper quarters in one keyframe, the lower ones in the next.
  const bool alternate = cells.size() > kLarge;
  int lower = 1;
  for (const KeyframeLook& look : looks) {
    if (plane.plane.distance(look.T_maplet_camera.t) < kBehindPlane_m) continue;
    const Se3 T_camera_maplet = look.T_maplet_camera.inverse();
    const Eigen::Vector3f u = (T_camera_maplet.q * basis.u * (0.5 * size_m)).cast<float>();
    const Eigen::Vector3f v = (T_camera_maplet.q * basis.v * (0.5 * size_m)).cast<float>();
    const Eigen::Vector3f corner =
        (T_camera_maplet * basis.point(grid.column0 * size_m, grid.row0 * size_m)).cast<float>() +
        0.5F * (u + v);
    const Window window{look.depth->camera};
    const Eigen::Vector3f across = static_cast<float>(2 * grid.columns - 1) * u;
    const Eigen::Vector3f down = static_cast<float>(2 * grid.rows - 1) * v;
    const Eigen::Vector3f far = corner + down;
    if ((window.outside(corner) & window.outside(corner + across) & window.outside(far) &
         window.outside(far + across)) != 0) {
      continue;
    }
    lower = alternate ? 1 - lower : 0;
    for (int line = lower; line < 2 * grid.rows; line += alternate ? 2 : 1) {
      const Eigen::Vector3f start = corner + static_cast<float>(line) * v;
      if ((window.outside(start) & window.outside(start + across)) != 0) continue;
      const int row = line / 2;
      for (int column = 0; column < grid.columns; ++column) {
        if (!out.cell(grid, column, row)) continue;
        CellLooks& cell = cells[static_cast<std::size_t>(row * grid.columns + column)];
        for (int half = 0; half < 2; ++half) {
          const Eigen::Vector3f p = start + static_cast<float>(2 * column + half) * u;
          if (p.z() < kNearest_m) continue;
          const float inverse = 1.0F / p.z();
          const float x = window.fx * p.x() * inverse + window.cx;
          const float y = window.fy * p.y() * inverse + window.cy;
          if (!(x >= 0.0F && y >= 0.0F && x < window.width && y < window.height)) continue;
          const float z_m = look.depth->at(x, y);
          if (z_m <= 0.0F) continue;
          const float off_m = z_m - p.z();
          const auto limit_m = static_cast<float>(behind_m(config_.fit_m, p.z()));
          if (off_m > limit_m) {
            ++cell.through;
          } else if (off_m >= -limit_m) {
            ++cell.on;
          }
        }
      }
    }
  }
  std::size_t at = 0;
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column, ++at) {
      const CellLooks& cell = cells[at];
      if (cell.through <= config_.max_free_share * (cell.on + cell.through)) continue;
      out.clear_cell(grid, column, row);
      ++counts_.cells_carved;
    }
  }
}

}  // namespace maplet
