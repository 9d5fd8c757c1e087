// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/plane_map.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/maplet/plane_view.hpp"

namespace maplet {

namespace {

constexpr double kAssociationChi2 = 21.0;  // 3 degrees of freedom, 0.9999
constexpr int kReachCells = 6;             // gap within one plane that association bridges

}  // namespace

PlaneMap::PlaneMap(const MapletConfig& config, Arena& arena)
    : config_{config},
      cells_{arena},
      planes_{arena.make_array<FusedPlane>(kPlanes, "maplet/planes")},
      order_{arena.make_array<std::uint16_t>(kMaxPatches, "maplet/patch order")},
      first_of_{arena.make_array<std::uint16_t>(kMaxFramePlanes + 2, "maplet/plane starts")},
      ranked_{arena.make_array<std::uint16_t>(kPlanes, "maplet/ranking")} {}

void PlaneMap::clear() noexcept {
  cells_.clear();
  planes_.count = 0;
  serial_ = 0;
  keyframe_ = 0;
  points_ = {};
}

void PlaneMap::add(const PatchSet& set, const KeptDepth& depth, const Se3& T_maplet_camera,
                   const Matrix6d& covariance, Deadline deadline) noexcept {
  ++keyframe_;
  points_.seen += set.valid_pixels;
  sort_patches(set);
  const View view{set, T_maplet_camera, T_maplet_camera.inverse(), covariance, order_, first_of_};
  for (std::size_t f = 0; f < set.planes.size(); ++f) {
    if (view.patches_of(f).empty()) continue;
    const PlaneSighting sighting = sight(view, f);
    FusedPlane* plane = associate(view, sighting, f);
    if (plane != nullptr) {
      plane->fuse(sighting, keyframe_);
    } else {
      plane = make_plane(sighting);
      if (plane == nullptr) continue;
    }
    for (const std::uint16_t i : view.patches_of(f)) place_patch(view, *plane, set.patches[i]);
  }
  place_loose(view);
  merge_alike();
  look({T_maplet_camera, &depth}, deadline);
}

// Those of one frame plane together, in their order.
void PlaneMap::sort_patches(const PatchSet& set) noexcept {
  const std::size_t planes = set.planes.size();
  std::fill(first_of_.begin(), first_of_.end(), std::uint16_t{0});
  const auto slot = [&](const Patch& p) {
    return p.plane >= 0 && p.plane < static_cast<int>(planes) ? static_cast<std::size_t>(p.plane)
                                                              : planes;
  };
  for (const Patch& p : set.patches) ++first_of_[slot(p)];
  std::uint16_t start = 0;
  for (std::size_t f = 0; f <= planes; ++f) {
    const std::uint16_t count = first_of_[f];
    first_of_[f] = start;
    start = static_cast<std::uint16_t>(start + count);
  }
  for (std::size_t i = 0; i < set.patches.size(); ++i) {
    order_[first_of_[slot(set.patches[i])]++] = static_cast<std::uint16_t>(i);
  }
  for (std::size_t f = planes + 1; f > 0; --f) first_of_[f] = first_of_[f - 1];
  first_of_[0] = 0;
}

PlaneSighting PlaneMap::sight(const View& view, std::size_t f) const noexcept {
  const FramePlane& seen = view.set.planes[f];
  const Plane plane = seen.plane();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double weight = 0.0;
  for (const std::uint16_t i : view.patches_of(f)) {
    const Patch& p = view.set.patches[i];
    centre += p.pixels * p.centre();
    weight += p.pixels;
  }
  centre /= std::max(weight, 1.0);
  PlaneSighting out = sight(view, plane, seen.information, centre);
  out.area_m2 = seen.area_m2;
  out.mean_gray = seen.mean_gray;
  return out;
}

PlaneSighting PlaneMap::sight(const View& view, const Plane& plane,
                              const Eigen::Matrix3d& information,
                              const Eigen::Vector3d& centre) const noexcept {
  const PlaneBasis basis{plane, PlaneBasis::best_axis(plane.n)};
  const Eigen::Vector3d on_plane = centre - plane.distance(centre) * plane.n;
  const PlaneTangent tangent{basis.u, basis.v, plane.n, on_plane};
  const Eigen::Matrix3d by_theta = tangent.jacobian_of_theta(plane);

  PlaneSighting out;
  out.by_pose = tangent.jacobian_of_motion();
  out.sensor = by_theta * information.inverse() * by_theta.transpose();
  out.plane = view.T_maplet_camera * plane;
  out.tangent = tangent.moved(view.T_maplet_camera);
  out.covariance = out.sensor + out.by_pose * view.covariance * out.by_pose.transpose();  // eq. 3
  out.covariance.diagonal().array() += 1e-10;
  return out;
}

FusedPlane* PlaneMap::associate(const View& view, const PlaneSighting& sighting,
                                std::size_t f) noexcept {
  FusedPlane* best = nullptr;
  double best_chi2 = kAssociationChi2;
  for (FusedPlane& plane : planes_.span()) {
    const double chi2 = plane.distance(sighting, config_.gate_distance_m, config_.gate_angle_rad);
    if (chi2 >= best_chi2 || !touches(view, plane, f)) continue;
    best = &plane;
    best_chi2 = chi2;
  }
  return best;
}

bool PlaneMap::touches(const View& view, const FusedPlane& plane, std::size_t f) noexcept {
  const auto patches = view.patches_of(f);
  const std::size_t step = std::max<std::size_t>(1, patches.size() / 24);
  for (std::size_t k = 0; k < patches.size(); k += step) {
    const Eigen::Vector3d p = view.T_maplet_camera * view.set.patches[patches[k]].centre();
    if (beside(plane, p, kReachCells)) return true;
  }
  return false;
}

// Whether the plane has a tile at p or `reach` cells away in one of eight directions.
bool PlaneMap::beside(const FusedPlane& plane, const Eigen::Vector3d& p, int reach) noexcept {
  const Eigen::Vector2d at = plane.anchor.coordinates(p) / config_.cell_m;
  if (at.cwiseAbs().maxCoeff() > 30000.0) return false;
  const int column = static_cast<int>(std::floor(at.x()));
  const int row = static_cast<int>(std::floor(at.y()));
  for (int dr = -reach; dr <= reach; dr += reach) {
    for (int dc = -reach; dc <= reach; dc += reach) {
      if (cells_.find(plane.serial, column + dc, row + dr) != nullptr) return true;
    }
  }
  return false;
}

FusedPlane* PlaneMap::make_plane(const PlaneSighting& sighting) noexcept {
  if (planes_.count == kPlanes) {
    const auto all = planes_.span();
    FusedPlane& least = *std::min_element(all.begin(), all.end(), [](const auto& a, const auto& b) {
      return a.touched * a.observations < b.touched * b.observations;
    });
    ++counts_.planes_dropped;
    const double cells = sighting.area_m2 / (config_.cell_m * config_.cell_m);
    if (cells < least.touched * least.observations) return nullptr;
    least = all.back();
    --planes_.count;
  }
  FusedPlane& plane = planes_.storage[planes_.count++];
  plane.start(sighting, ++serial_, keyframe_);
  return &plane;
}

void PlaneMap::merge_alike() noexcept {
  for (std::size_t i = 0; i < planes_.count; ++i) {
    for (std::size_t k = i + 1; k < planes_.count;) {
      FusedPlane& a = planes_.storage[i];
      FusedPlane& b = planes_.storage[k];
      const bool seen_now = a.last_keyframe == keyframe_ || b.last_keyframe == keyframe_;
      const bool alike =
          seen_now && a.plane.n.dot(b.plane.n) > std::cos(config_.gate_angle_rad) &&
          std::abs(a.plane.distance(b.tangent.centre)) < config_.fit_m &&
          std::abs(b.plane.distance(a.tangent.centre)) < config_.fit_m &&
          (beside(a, b.tangent.centre, kReachCells) || beside(b, a.tangent.centre, kReachCells));
      if (!alike) {
        ++k;
        continue;
      }
      if (a.touched < b.touched) std::swap(a, b);
      absorb(a, b);
      b = planes_.storage[--planes_.count];
    }
  }
}

// The other's sightings are one more sighting; its cells move over.
void PlaneMap::absorb(FusedPlane& keep, FusedPlane& gone) noexcept {
  PlaneSighting sum;
  sum.plane = gone.plane;
  sum.tangent = gone.tangent;
  sum.covariance = gone.covariance();
  sum.area_m2 = gone.gray_area_m2;
  sum.mean_gray =
      gone.gray_area_m2 > 0.0 ? static_cast<float>(gone.gray_sum / gone.gray_area_m2) : -1.0F;
  const std::uint16_t observations = std::max(keep.observations, gone.observations);
  const std::uint32_t last = std::max(keep.last_keyframe, gone.last_keyframe);
  keep.fuse(sum, last);
  keep.observations = observations;
  keep.last_keyframe = last;
  keep.points += gone.points;
  for (std::int32_t t = gone.first_tile; t >= 0; t = cells_.tile(t).next) {
    for (int cell = 0; cell < Tile::kSide * Tile::kSide; ++cell) {
      const Tile& from = cells_.tile(t);
      if (((from.touched >> cell) & 1U) == 0) continue;
      const Eigen::Vector3d p =
          gone.anchor.point((from.column * 8 + cell % 8 + 0.5) * config_.cell_m,
                            (from.row * 8 + cell / 8 + 0.5) * config_.cell_m);
      const Eigen::Vector2d at = keep.anchor.coordinates(p) / config_.cell_m;
      const int column = static_cast<int>(std::floor(at.x()));
      const int row = static_cast<int>(std::floor(at.y()));
      Tile* to = cells_.make(keep.serial, keep.first_tile, column, row);
      if (to == nullptr) {
        ++counts_.tiles_missing;
        continue;
      }
      const int into = CellMap::index_in_tile(column, row);
      const std::uint64_t bit = std::uint64_t{1} << into;
      if ((to->touched & bit) == 0) ++keep.touched;
      to->touched |= bit;
      to->hits[into] = static_cast<std::uint8_t>(std::min(255, to->hits[into] + from.hits[cell]));
      to->frees[into] =
          static_cast<std::uint8_t>(std::min(255, to->frees[into] + from.frees[cell]));
    }
  }
}

bool PlaneMap::open(const Eigen::Vector3d& from, const Eigen::Vector3d& to) noexcept {
  for (const FusedPlane& plane : planes_.span()) {
    const double before = plane.plane.distance(from);
    const double after = plane.plane.distance(to);
    if (before * after >= 0.0) continue;
    const Eigen::Vector2d at =
        plane.anchor.coordinates(from + before / (before - after) * (to - from)) / config_.cell_m;
    if (!(at.cwiseAbs().maxCoeff() < 30000.0)) continue;
    for (const double dy : {-0.5, 0.5}) {
      for (const double dx : {-0.5, 0.5}) {
        const int column = static_cast<int>(std::floor(at.x() + dx));
        const int row = static_cast<int>(std::floor(at.y() + dy));
        const Tile* tile = cells_.find(plane.serial, column, row);
        const int cell = CellMap::index_in_tile(column, row);
        if (tile != nullptr && tile->occupied(cell, config_.max_free_share)) return false;
      }
    }
  }
  return true;
}

std::size_t PlaneMap::estimated_bytes() const noexcept {
  double cells = 0.0;
  std::size_t count = 0;
  for (const FusedPlane& p : planes_.span()) {
    const double area = p.touched * config_.cell_m * config_.cell_m;
    if (area < config_.min_area_m2) continue;
    ++count;
    cells += p.touched;
  }
  return 22 * std::min(count, kMaxMapletPlanes) + static_cast<std::size_t>(cells * 0.12);
}

}  // namespace maplet
