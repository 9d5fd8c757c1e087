// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/place_descriptor.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace maplet {

namespace {

constexpr double kLargest_m2 = 1.5;       // larger planes count for no more: walls are common
constexpr float kAxisCosine = 0.978F;     // 12 deg
constexpr std::size_t kSeeds = 10;        // planes that may begin an axis: the weightiest
constexpr float kLeastAxisShare = 0.02F;  // of all planes' weight
constexpr double kFurthest_m = 100.0;     // of a plane that says anything about a place

PlacePlane place_of(const Maplet& m, const MapletPlane& p) noexcept {
  const PlaneBasis basis = p.basis();
  const double size = m.cell_m_of(p.grid);
  PlacePlane out;
  out.n = p.plane.n.cast<float>();
  out.u = basis.u.cast<float>();
  out.centre = basis
                   .point((p.grid.column0 + 0.5 * p.grid.columns) * size,
                          (p.grid.row0 + 0.5 * p.grid.rows) * size)
                   .cast<float>();
  out.half_u_m = static_cast<float>(0.5 * p.grid.columns * size);
  out.half_v_m = static_cast<float>(0.5 * p.grid.rows * size);
  out.weight = static_cast<float>(std::sqrt(std::min(p.area_m2, kLargest_m2)));
  return out;
}

// The direction that most of the weight not yet taken is perpendicular to.
Eigen::Vector3f strongest(const PlaceDescriptor& d,
                          const std::array<bool, PlaceDescriptor::kPlanes>& taken) noexcept {
  Eigen::Vector3f best = Eigen::Vector3f::Zero();
  float most = 0.0F;
  std::size_t seeds = 0;
  for (std::size_t i = 0; i < d.planes.size() && seeds < kSeeds; ++i) {
    if (taken[i]) continue;
    ++seeds;
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    float weight = 0.0F;
    for (std::size_t k = 0; k < d.planes.size(); ++k) {
      const float cosine = d.planes[i].n.dot(d.planes[k].n);
      if (taken[k] || std::abs(cosine) < kAxisCosine) continue;
      sum += std::copysign(d.planes[k].weight, cosine) * d.planes[k].n;
      weight += d.planes[k].weight;
    }
    if (weight <= most) continue;
    most = weight;
    best = sum.normalized();
  }
  return best;
}

}  // namespace

void PlaceDescriptor::describe(const Maplet& maplet, PlaceDescriptor& out) noexcept {
  out.key = maplet.key;
  out.up = maplet.up.cast<float>();
  out.weight = 0.0F;
  out.planes.clear();
  out.axes.clear();
  for (const MapletPlane& p : maplet.planes) {  // the largest first
    if (out.planes.full()) break;
    if (p.grid.occupied == 0 || !(p.centre.norm() < kFurthest_m)) continue;
    out.planes.push_back(place_of(maplet, p));
    out.weight += out.planes.back().weight;
  }
  std::array<bool, kPlanes> taken{};
  while (!out.axes.full()) {
    PlaceAxis axis;
    axis.direction = strongest(out, taken);
    if (axis.direction.isZero()) break;
    for (std::size_t i = 0; i < out.planes.size(); ++i) {
      const PlacePlane& p = out.planes[i];
      const float cosine = axis.direction.dot(p.n);
      if (taken[i] || std::abs(cosine) < kAxisCosine) continue;
      taken[i] = true;
      if (axis.marks.full()) continue;
      axis.marks.push_back(PlaceAxis::Mark{axis.direction.dot(p.centre), p.weight, cosine > 0.0F});
      axis.weight += p.weight;
    }
    // An outlier of its own mean: nothing taken, nothing more to find.
    if (axis.marks.empty() || axis.weight < kLeastAxisShare * out.weight) break;
    out.axes.push_back(axis);
  }
}

}  // namespace maplet
