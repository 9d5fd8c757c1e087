// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <compare>
#include <cstdint>

#include "core/base/clock.hpp"
#include "core/base/static_vector.hpp"
#include "core/geometry/plane.hpp"
#include "core/geometry/se3.hpp"
#include "core/limits.hpp"

namespace maplet {

/// Which maplet, of all agents and all their lives.
struct MapletKey {
  std::uint16_t agent = 0;
  std::uint32_t epoch = 0;  ///< one life of the agent (docs/records.md)
  std::uint32_t id = 0;     ///< counts up from 0 in one epoch

  friend auto operator<=>(const MapletKey&, const MapletKey&) = default;
};

/// Coordinates on a plane: origin at the foot of the perpendicular from the frame's origin, u along
/// the projection of the frame's axis `axis` (0, 1, 2), u x v = n.
///
/// Math   docs/math/maplet.md, eq. 1.
struct PlaneBasis {
  Eigen::Vector3d foot, u, v;

  PlaneBasis(const Plane& plane, int axis) noexcept;
  /// The axis that lies flattest in a plane.
  [[nodiscard]] static std::uint8_t best_axis(const Eigen::Vector3d& n) noexcept;
  [[nodiscard]] Eigen::Vector3d point(double a_m, double b_m) const noexcept {
    return foot + a_m * u + b_m * v;
  }
  [[nodiscard]] Eigen::Vector2d coordinates(const Eigen::Vector3d& p) const noexcept {
    return {(p - foot).dot(u), (p - foot).dot(v)};
  }
};

/// Where on its plane a surface was seen: a bitmap in the plane's basis.
struct CellGrid {
  std::uint32_t first_bit = 0;  ///< in Maplet::cells, row by row
  std::int16_t column0 = 0;     ///< of the grid's first column: it spans [column0, +1) * cell
  std::int16_t row0 = 0;
  std::uint16_t columns = 0;  ///< 0..kMaxGridCells
  std::uint16_t rows = 0;
  std::uint8_t level = 0;      ///< its cells are cell_m * 2^level wide
  std::uint8_t axis = 0;       ///< of its basis
  std::uint32_t occupied = 0;  ///< cells that are set

  static constexpr std::uint8_t kMaxLevel = 7;
};

/// One plane of a maplet.
struct MapletPlane {
  std::uint8_t id = 0;            ///< its index in Maplet::planes
  std::uint8_t observations = 0;  ///< keyframes that saw it, 255 = that many or more
  float mean_gray = -1.0F;        ///< 1..255; negative when there is no gray image
  Plane plane;                    ///< maplet's frame; n keeps the seen side
  double area_m2 = 0.0;           ///< of its occupied cells
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of its occupied cells, on the plane
  /// Of (alpha, beta, h): n turns to n + alpha u + beta v about `centre`, and the plane moves by h
  /// against n there (rad, rad, m; docs/math/maplet.md, eq. 2).
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  CellGrid grid;

  [[nodiscard]] PlaneBasis basis() const noexcept { return {plane, grid.axis}; }
};

/// A keyframe that the maplet was made of.
struct MapletKeyframe {
  Stamp stamp{};
  Transform<MapletFrame, CameraFrame> T_maplet_camera;
};

/// A small map of planes in the frame of the depth camera at its origin, its first keyframe.
///
/// Memory   fixed, ~50 KB: lives in the builder's or the agent's arena, never on a small stack.
/// Threads  a value.
struct Maplet {
  MapletKey key;
  Stamp stamp{};                                                ///< of its origin
  double cell_m = 0.05;                                         ///< width of a level 0 cell
  StaticVector<MapletKeyframe, kMaxMapletKeyframes> keyframes;  ///< [0] is the origin
  StaticVector<MapletPlane, kMaxMapletPlanes> planes;           ///< the largest first
  /// Unit vector against gravity, maplet's frame; zero: not known.
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  bool complete = true;          ///< false: decoded from its coarse layers only
  std::uint32_t cells_used = 0;  ///< bits
  std::array<std::uint64_t, kMaxMapletCells / 64> cells{};

  [[nodiscard]] bool cell(const CellGrid& grid, int column, int row) const noexcept {
    const std::uint32_t bit = grid.first_bit + static_cast<std::uint32_t>(row) * grid.columns +
                              static_cast<std::uint32_t>(column);
    return ((cells[bit / 64] >> (bit % 64)) & 1U) != 0U;
  }
  void set_cell(const CellGrid& grid, int column, int row) noexcept {
    const std::uint32_t bit = grid.first_bit + static_cast<std::uint32_t>(row) * grid.columns +
                              static_cast<std::uint32_t>(column);
    cells[bit / 64] |= std::uint64_t{1} << (bit % 64);
  }
  void clear_cell(const CellGrid& grid, int column, int row) noexcept {
    const std::uint32_t bit = grid.first_bit + static_cast<std::uint32_t>(row) * grid.columns +
                              static_cast<std::uint32_t>(column);
    cells[bit / 64] &= ~(std::uint64_t{1} << (bit % 64));
  }
  [[nodiscard]] double cell_m_of(const CellGrid& grid) const noexcept {
    return cell_m * (1 << grid.level);
  }
  /// Whether the surface was seen where p projects onto it. Time O(1).
  [[nodiscard]] bool covers(const MapletPlane& plane, const Eigen::Vector3d& p) const noexcept;
  /// Takes bits for plane.grid (columns and rows set, all cells cleared).
  /// @return false when there are not enough left: coarsen
  [[nodiscard]] bool take_cells(CellGrid& grid) noexcept;
  /// Undoes the last take_cells.
  void give_back(const CellGrid& grid) noexcept;
  /// Sets occupied, area_m2 and centre of a plane whose cells are set.
  void measure_extent(MapletPlane& plane) const noexcept;
  void clear() noexcept;
};

}  // namespace maplet
