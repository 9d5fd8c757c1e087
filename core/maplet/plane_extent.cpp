// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Where on its plane a surface is: cells that patches cover and that later looks confirm.
#include <algorithm>
#include <cmath>

#include "core/maplet/plane_map.hpp"
#include "core/maplet/plane_view.hpp"

namespace maplet {

namespace {

constexpr int kMaxSteps = 96;
constexpr double kStepCells = 0.8;         // between rays: cells missed by one keyframe are few
constexpr int kMaxCell = 30000;            // of a plane's grid
constexpr double kMinInverseDepth = 0.02;  // 50 m
constexpr double kLooseAngle = 0.85;       // cosine between a loose patch and the plane it joins

// Towards minus infinity, for |x| < 2 * kMaxCell.
int floor_of(double x) noexcept { return static_cast<int>(x + 2 * kMaxCell) - 2 * kMaxCell; }

// Depth noise of a cell's look grows with the square of the distance.
double slack_m(double fit_m, double depth_m) noexcept {
  return 1.5 * fit_m + 0.002 * depth_m * depth_m;
}

}  // namespace

// Marks the cells under a patch: rays not quite a cell apart, cut with the plane (eq. 6).
void PlaneMap::place_patch(const View& view, FusedPlane& plane, const Patch& patch) noexcept {
  const Plane local = view.T_camera_maplet * plane.plane;
  const Eigen::Vector3d centre = patch.centre();
  if (local.d <= 0.0 ||
      std::abs(local.distance(centre)) > slack_m(config_.fit_m, centre.z()) * 0.7) {
    ++counts_.patches_unfit;
    return;
  }
  ++counts_.patches_placed;
  plane.points += patch.pixels;
  const CameraModel& camera = view.set.camera;
  const double slant = std::max(0.1, -local.n.dot(centre) / centre.norm());
  const double step_px = kStepCells * config_.cell_m / centre.z() * std::abs(camera.fx_px) * slant;
  const auto steps = [&](double px) {
    return std::clamp(static_cast<int>(std::ceil(px / step_px)), 1, kMaxSteps);
  };
  const int across = steps(patch.width_px);
  const int down = steps(patch.height_px);

  const Eigen::Vector3d theta = local.theta();
  const Eigen::Vector3d a = view.T_camera_maplet.q * plane.anchor.u / config_.cell_m;
  const Eigen::Vector3d b = view.T_camera_maplet.q * plane.anchor.v / config_.cell_m;
  const Eigen::Vector2d offset = plane.anchor.coordinates(view.T_maplet_camera.t) / config_.cell_m;
  // theta . ray, a . ray and b . ray change alike from one ray to the next.
  const double wide_px = static_cast<double>(patch.width_px) / across;
  const double high_px = static_cast<double>(patch.height_px) / down;
  const Eigen::Vector3d ray =
      camera.ray(patch.u_px - 0.5 + 0.5 * wide_px, patch.v_px - 0.5 + 0.5 * high_px);
  Eigen::Matrix3d rows;
  rows << theta.transpose(), a.transpose(), b.transpose();
  const Eigen::Vector3d first = rows * ray;
  const Eigen::Vector3d right = rows.col(0) * (wide_px / camera.fx_px);
  const Eigen::Vector3d below = rows.col(1) * (high_px / camera.fy_px);
  Tile* tile = nullptr;
  for (int j = 0; j < down; ++j) {
    for (int i = 0; i < across; ++i) {
      const Eigen::Vector3d at = first + i * right + j * below;
      if (at.x() < kMinInverseDepth) continue;
      const double depth_m = 1.0 / at.x();
      const double x = at.y() * depth_m + offset.x();
      const double y = at.z() * depth_m + offset.y();
      if (!(std::abs(x) < kMaxCell && std::abs(y) < kMaxCell)) continue;
      const int column = floor_of(x);
      const int row = floor_of(y);
      if (tile == nullptr || tile->column != (column >> 3) || tile->row != (row >> 3)) {
        tile = cells_.make(plane.serial, plane.first_tile, column, row);
        if (tile == nullptr) {
          ++counts_.tiles_missing;
          continue;
        }
      }
      const std::uint64_t bit = std::uint64_t{1} << CellMap::index_in_tile(column, row);
      if ((tile->touched & bit) == 0) ++plane.touched;
      tile->touched |= bit;
    }
  }
}

// Patches that no frame plane took widen the map's planes where they fit and touch one.
void PlaneMap::place_loose(const View& view) noexcept {
  for (const std::uint16_t i : view.patches_of(view.set.planes.size())) {
    const Patch& patch = view.set.patches[i];
    const Eigen::Vector3d centre = view.T_maplet_camera * patch.centre();
    const Eigen::Vector3d n = view.T_maplet_camera.q * Plane::from_theta(patch.theta).n;
    FusedPlane* best = nullptr;
    double least = config_.fit_m;
    for (FusedPlane& plane : planes_.span()) {
      const double off = std::abs(plane.plane.distance(centre));
      if (off >= least || plane.plane.n.dot(n) < kLooseAngle) continue;
      if (!beside(plane, centre, 2)) continue;
      best = &plane;
      least = off;
    }
    if (best == nullptr) {
      ++counts_.patches_loose;
      place_quad(view, patch);
    } else {
      place_patch(view, *best, patch);
    }
  }
}

// A loose patch is a small plane of its own where it is large enough to be written at all.
void PlaneMap::place_quad(const View& view, const Patch& patch) noexcept {
  const Plane plane = Plane::from_theta(patch.theta);
  const Eigen::Vector3d centre = patch.centre();
  const double slant = std::max(0.1, -plane.n.dot(centre) / centre.norm());
  const double pixel_m = centre.z() / std::abs(view.set.camera.fx_px);
  const double area_m2 = patch.pixels * pixel_m * pixel_m / slant;
  FusedPlane* made = nullptr;
  if (area_m2 >= config_.min_area_m2) {
    PlaneSighting sighting = sight(view, plane, patch.information, centre);
    sighting.area_m2 = area_m2;
    sighting.mean_gray = patch.mean_gray;
    made = make_plane(sighting);
  }
  if (made == nullptr) {
    ++counts_.quads_left_out;
    return;
  }
  ++counts_.quads_kept;
  place_patch(view, *made, patch);
}

// Every cell in view is looked at: surface there, or seen through?
void PlaneMap::look(const KeyframeLook& keyframe, Deadline deadline) noexcept {
  const DepthLook look{*keyframe.depth, config_.fit_m};
  const CameraModel& camera = keyframe.depth->camera();
  const Se3 T_camera_maplet = keyframe.T_maplet_camera.inverse();
  const double reach = Tile::kSide * config_.cell_m * 0.75;
  for (const FusedPlane& plane : planes_.span()) {
    if (plane.plane.distance(keyframe.T_maplet_camera.t) < kBehindPlane_m)
      continue;  // seen from behind
    if (deadline.expired()) {
      ++counts_.deadline_misses;
      return;
    }
    for (std::int32_t t = plane.first_tile; t >= 0; t = cells_.tile(t).next) {
      Tile& tile = cells_.tile(t);
      const Eigen::Vector3d centre =
          T_camera_maplet * plane.anchor.point((tile.column + 0.5) * Tile::kSide * config_.cell_m,
                                               (tile.row + 0.5) * Tile::kSide * config_.cell_m);
      if (centre.z() < 0.2) continue;
      const double margin = reach / centre.z() * std::abs(camera.fx_px);
      const Eigen::Vector2d px = camera.project(centre);
      if (px.x() < -margin || px.y() < -margin || px.x() > camera.width_px + margin ||
          px.y() > camera.height_px + margin) {
        continue;
      }
      look_at_tile(look, T_camera_maplet, plane, tile);
    }
  }
}

// Each cell is looked at in its four quarters, eq. 6; also those that no patch has covered yet:
// what went through them before counts when one does.
void PlaneMap::look_at_tile(const DepthLook& look, const Se3& T_camera_maplet,
                            const FusedPlane& plane, Tile& tile) const noexcept {
  const double step_m = 0.5 * config_.cell_m;
  const Eigen::Vector3f u = look.pixels(T_camera_maplet.q * plane.anchor.u * step_m);
  const Eigen::Vector3f v = look.pixels(T_camera_maplet.q * plane.anchor.v * step_m);
  const Eigen::Vector3f corner =
      look.pixels(T_camera_maplet * plane.anchor.point(tile.column * Tile::kSide * config_.cell_m,
                                                       tile.row * Tile::kSide * config_.cell_m)) +
      0.5F * (u + v);
  for (int cell = 0; cell < Tile::kSide * Tile::kSide; ++cell) {
    const Eigen::Vector3f first = corner + static_cast<float>(2 * (cell % Tile::kSide)) * u +
                                  static_cast<float>(2 * (cell / Tile::kSide)) * v;
    for (int part = 0; part < 4; ++part) {
      const Eigen::Vector3f p =
          first + static_cast<float>(part & 1) * u + static_cast<float>(part >> 1) * v;
      const DepthLook::Seen seen = look.at(p);
      if (seen != DepthLook::Seen::kNothing) tile.vote(cell, seen == DepthLook::Seen::kSurface);
    }
  }
}

}  // namespace maplet
