// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// From the map under construction to the maplet's compact planes.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/maplet/codec.hpp"
#include "core/maplet/plane_map.hpp"

namespace maplet {

namespace {

// What a plane tells: its surface, and that it was seen again.
double worth(const FusedPlane& plane) noexcept {
  return plane.touched * (plane.observations > 1 ? 1.0 : 0.3);
}

constexpr double kTurned =
    codec::kMaxLean - 0.01;  // since its grid was begun: far from what it was

struct Bounds {
  Eigen::Array2d low = Eigen::Array2d::Constant(1e9);
  Eigen::Array2d high = Eigen::Array2d::Constant(-1e9);
};

}  // namespace

// Calls f(point on the anchor plane) for each occupied cell.
template <class F>
void PlaneMap::for_occupied(const FusedPlane& plane, F f) const noexcept {
  for (std::int32_t t = plane.first_tile; t >= 0; t = cells_.tile(t).next) {
    const Tile& tile = cells_.tile(t);
    for (int cell = 0; cell < Tile::kSide * Tile::kSide; ++cell) {
      if (!tile.occupied(cell, config_.max_free_share)) continue;
      f(plane.anchor.point((tile.column * Tile::kSide + cell % Tile::kSide + 0.5) * config_.cell_m,
                           (tile.row * Tile::kSide + cell / Tile::kSide + 0.5) * config_.cell_m));
    }
  }
}

// Whether a cell of the settled plane's grid is surface, by what was seen in the cells of the
// anchor's grid that lie under it: they do not fall on each other.
bool PlaneMap::surface_in(const FusedPlane& from, const PlaneBasis& basis, const CellGrid& grid,
                          int column, int row) const noexcept {
  const int side = 2 << grid.level;
  const double step_m = 0.5 * config_.cell_m;
  int touched = 0;
  int hits = 0;
  int frees = 0;
  for (int k = 0; k < side * side; ++k) {
    const double x = ((grid.column0 + column) * side + k % side + 0.5) * step_m;
    const double y = ((grid.row0 + row) * side + k / side + 0.5) * step_m;
    const Eigen::Vector2d at = from.anchor.coordinates(basis.point(x, y)) / config_.cell_m;
    const int c = static_cast<int>(std::floor(at.x()));
    const int r = static_cast<int>(std::floor(at.y()));
    const Tile* tile = cells_.find(from.serial, c, r);
    const int cell = CellMap::index_in_tile(c, r);
    if (tile == nullptr || ((tile->touched >> cell) & 1U) == 0) continue;
    ++touched;
    hits += tile->hits[cell];
    frees += tile->frees[cell];
  }
  return 2 * touched >= side * side && is_surface(hits, frees, config_.max_free_share);
}

bool PlaneMap::lay_grid(const FusedPlane& from, Maplet& out, MapletPlane& plane) const noexcept {
  const PlaneBasis basis = plane.basis();
  Bounds bounds;
  for_occupied(from, [&](const Eigen::Vector3d& p) {
    const Eigen::Array2d at = basis.coordinates(p).array() / config_.cell_m;
    bounds.low = bounds.low.min(at);
    bounds.high = bounds.high.max(at);
  });
  if (!(bounds.low.x() <= bounds.high.x())) return false;
  CellGrid& grid = plane.grid;
  for (grid.level = 0; grid.level <= CellGrid::kMaxLevel; ++grid.level) {
    const double scale = 1.0 / (1 << grid.level);
    const Eigen::Array2d first = (bounds.low * scale).floor();
    const Eigen::Array2d count = (bounds.high * scale).floor() - first + 1.0;
    if (count.maxCoeff() > kMaxGridCells) continue;
    if (first.abs().maxCoeff() > codec::kMaxGridIndex) continue;
    grid.column0 = static_cast<std::int16_t>(first.x());
    grid.row0 = static_cast<std::int16_t>(first.y());
    grid.columns = static_cast<std::uint16_t>(count.x());
    grid.rows = static_cast<std::uint16_t>(count.y());
    if (!out.take_cells(grid)) continue;
    for (int row = 0; row < grid.rows; ++row) {
      for (int column = 0; column < grid.columns; ++column) {
        if (surface_in(from, basis, grid, column, row)) out.set_cell(grid, column, row);
      }
    }
    return true;
  }
  return false;
}

void PlaneMap::assemble(Maplet& out, std::span<const KeyframeLook> looks, std::size_t limit,
                        Deadline deadline) noexcept {
  out.cell_m = config_.cell_m;
  points_.kept = 0;
  const auto ranked = ranked_.first(planes_.count);
  for (std::size_t i = 0; i < ranked.size(); ++i) ranked[i] = static_cast<std::uint16_t>(i);
  std::sort(ranked.begin(), ranked.end(), [&](std::uint16_t a, std::uint16_t b) {
    const FusedPlane& x = planes_.storage[a];
    const FusedPlane& y = planes_.storage[b];
    const double difference = worth(x) - worth(y);
    return difference != 0.0 ? difference > 0.0 : x.serial < y.serial;
  });
  for (const std::uint16_t i : ranked) {
    const FusedPlane& from = planes_.storage[i];
    if (from.touched * config_.cell_m * config_.cell_m < config_.min_area_m2) continue;
    MapletPlane plane;
    plane.plane = from.plane;
    plane.grid.axis = from.axis;
    if (std::abs(from.plane.n[from.axis]) > kTurned) {
      ++counts_.planes_dropped;
      continue;
    }
    if (!lay_grid(from, out, plane)) continue;
    if (!looks.empty()) {
      if (deadline.expired()) {
        ++counts_.deadline_misses;
      } else {
        carve(looks, out, plane);
      }
    }
    out.measure_extent(plane);
    if (plane.area_m2 < config_.min_area_m2) {
      out.give_back(plane.grid);
      continue;
    }
    if (out.planes.size() >= std::min(limit, kMaxMapletPlanes)) {
      out.give_back(plane.grid);
      ++counts_.planes_trimmed;
      continue;
    }
    const PlaneBasis basis = plane.basis();
    const PlaneTangent tangent{basis.u, basis.v, plane.plane.n, plane.centre};
    const Eigen::Matrix3d change = from.tangent.change_to(tangent);
    plane.covariance = change * from.honest_covariance() * change.transpose();
    plane.covariance.diagonal() +=
        Eigen::Vector3d{config_.floor_rad, config_.floor_rad, config_.floor_m}
            .cwiseAbs2();  // eq. 7
    plane.id = static_cast<std::uint8_t>(out.planes.size());
    plane.observations = static_cast<std::uint8_t>(std::min<int>(from.observations, 255));
    if (from.gray_area_m2 > 0.0) {
      plane.mean_gray = static_cast<float>(from.gray_sum / from.gray_area_m2);
    }
    out.planes.push_back(plane);
    points_.kept += from.points;
  }
}

}  // namespace maplet
