// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/evidence.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr int kSamples = 9;     // of a plane
constexpr double kFar_m = 4.5;  // further away a camera is not believed
constexpr double kNear_m = 0.5;
constexpr double kTanX = 0.48;  // of half the field of view, a little inside
constexpr double kTanY = 0.36;
constexpr double kGrazing = 0.17;   // cosine: 80 deg
constexpr double kSame_m = 0.08;    // of surfaces, across
constexpr double kBehind_m = 0.15;  // further behind is another surface
constexpr double kLargest_m2 = 1.5;

// The keyframe that sees p best, or nullptr: in view, from the plane's seen side.
const Se3* viewer(const Maplet& m, const Eigen::Vector3d& p, const Eigen::Vector3d& n) noexcept {
  const Se3* best = nullptr;
  double least = kFar_m;
  for (const MapletKeyframe& k : m.keyframes) {
    const Se3& T = k.T_maplet_camera.se3;
    const Eigen::Vector3d ray = p - T.t;
    const double distance = ray.norm();
    if (distance >= least || distance < kNear_m || n.dot(ray) > -kGrazing * distance) continue;
    const Eigen::Vector3d at = T.q.conjugate() * ray;
    if (at.z() < kNear_m || std::abs(at.x()) > kTanX * at.z() ||
        std::abs(at.y()) > kTanY * at.z()) {
      continue;
    }
    least = distance;
    best = &T;
  }
  return best;
}

enum class Look { kNothing, kSame, kThrough };

// What m has along the ray from a camera of its own to p, a point of a surface with normal n.
Look look(const Maplet& m, const Eigen::Vector3d& camera, const Eigen::Vector3d& p,
          const Eigen::Vector3d& n) noexcept {
  const Eigen::Vector3d ray = p - camera;
  const double length = ray.norm();
  const double behind = 1.0 + kBehind_m / length;
  bool through = false;
  for (const MapletPlane& plane : m.planes) {
    const double from = plane.plane.distance(camera);
    const double toward = plane.plane.n.dot(ray);
    if (from < 0.05 || toward > -1e-6) continue;  // seen from behind
    const double at = from / -toward;             // in lengths of the ray
    const double across = std::abs(plane.plane.distance(p));
    const bool same = across < kSame_m && plane.plane.n.dot(n) > 0.9;
    if (!same && through && at > behind) continue;
    if (!m.covers(plane, same ? p : Eigen::Vector3d{camera + at * ray})) continue;
    if (same) return Look::kSame;
    if (at < behind) return Look::kNothing;  // hidden, or something else at about the same place
    through = true;
  }
  return through ? Look::kThrough : Look::kNothing;
}

// How `seen`'s planes fare in the eyes of `by`.
void weigh(const Maplet& seen, const Maplet& by, const Se3& T_by_seen, Deadline deadline,
           Evidence& out) noexcept {
  for (const MapletPlane& plane : seen.planes) {
    if (deadline.expired()) {
      out.complete = false;
      return;
    }
    const CellGrid& grid = plane.grid;
    if (grid.occupied == 0) continue;
    const PlaneBasis basis = plane.basis();
    const double size = seen.cell_m_of(grid);
    const Eigen::Vector3d n = T_by_seen.q * plane.plane.n;
    const std::uint32_t cells = std::uint32_t{grid.columns} * grid.rows;
    // A stride that has no divisor in common with the width: samples spread over both axes.
    const std::uint32_t step = std::max<std::uint32_t>(1, cells * 10 / (16 * kSamples)) | 1U;
    int same = 0;
    int through = 0;
    int looks = 0;
    std::uint32_t cell = cells / 2;
    for (std::uint32_t tried = 0; tried < 4 * kSamples && looks < kSamples; ++tried) {
      cell = (cell + step) % cells;
      const int column = static_cast<int>(cell % grid.columns);
      const int row = static_cast<int>(cell / grid.columns);
      if (!seen.cell(grid, column, row)) continue;
      ++looks;
      const Eigen::Vector3d p = T_by_seen * basis.point((grid.column0 + column + 0.5) * size,
                                                        (grid.row0 + row + 0.5) * size);
      const Se3* camera = viewer(by, p, n);
      if (camera == nullptr) continue;
      const Look found = look(by, camera->t, p, n);
      same += found == Look::kSame ? 1 : 0;
      through += found == Look::kThrough ? 1 : 0;
    }
    if (looks == 0) continue;
    const double weight = std::sqrt(std::min(plane.area_m2, kLargest_m2)) / looks;
    out.agreed += weight * same;
    out.contradicted += weight * through;
    if (plane.area_m2 < Evidence::kSmall_m2) out.small_agreed += weight * same;
  }
}

}  // namespace

Evidence weigh_evidence(const Maplet& a, const Maplet& b, const Se3& T_a_b,
                        Deadline deadline) noexcept {
  Evidence out;
  weigh(b, a, T_a_b, deadline, out);
  weigh(a, b, T_a_b.inverse(), deadline, out);
  return out;
}

}  // namespace maplet
