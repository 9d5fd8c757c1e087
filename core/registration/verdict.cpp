// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/verdict.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr double kSamePlace_m = 0.1;
constexpr double kSamePlace_rad = 0.05;
constexpr double kNearlyAsGood = 0.8;  // of the best hypothesis' matched area and pairs

// Matched area, less where the fit is bad.
double score(const MapletAlignment& alignment) noexcept {
  return alignment.overlap / (1.0 + alignment.chi2_per_dof);
}

// Whether y is another place than the alignment's, free axes aside.
bool differ(const MapletAlignment& x, const Se3& y) noexcept {
  Vector6d apart = (x.T_a_b.se3.inverse() * y).log();
  for (const Vector6d& axis : x.free_axes) apart -= axis.dot(apart) * axis;
  return apart.head<3>().norm() > kSamePlace_m || apart.tail<3>().norm() > kSamePlace_rad;
}

// Does the segment from p to q cross a surface of m, away from its ends?
bool crosses(const Maplet& m, const Eigen::Vector3d& p, const Eigen::Vector3d& q) noexcept {
  constexpr double kMargin_m = 0.2;
  for (const MapletPlane& plane : m.planes) {
    const double dp = plane.plane.distance(p);
    const double dq = plane.plane.distance(q);
    if (dp < kMargin_m || dq > -kMargin_m) continue;  // only from its seen side
    if (m.covers(plane, p + dp / (dp - dq) * (q - p))) return true;
  }
  return false;
}

}  // namespace

double blocked_sight(const Maplet& a, const Maplet& b, const Se3& T_a_b) noexcept {
  constexpr int kPerPlane = 8;
  const Se3 T_b_a = T_a_b.inverse();
  int looks = 0;
  int blocked = 0;
  for (const MapletPlane& plane : a.planes) {
    const CellGrid& grid = plane.grid;
    const PlaneBasis basis = plane.basis();
    const double size = a.cell_m_of(grid);
    const int cells = grid.columns * grid.rows;
    const int step = std::max(1, cells / kPerPlane);
    for (int cell = step / 2; cell < cells; cell += step) {
      const int column = cell % grid.columns;
      const int row = cell / grid.columns;
      if (!a.cell(grid, column, row)) continue;
      const Eigen::Vector3d p =
          basis.point((grid.column0 + column + 0.5) * size, (grid.row0 + row + 0.5) * size);
      // The nearest camera that it may have been seen from.
      const MapletKeyframe* nearest = nullptr;
      double least = 5.0;
      for (const MapletKeyframe& k : a.keyframes) {
        const Eigen::Vector3d at = k.T_maplet_camera.inverse() * p;
        const bool in_view =
            at.z() > 0.4 && std::abs(at.x()) < 0.5 * at.z() && std::abs(at.y()) < 0.38 * at.z();
        if (!in_view || at.norm() >= least) continue;
        if (plane.plane.distance(k.T_maplet_camera.se3.t) < 0.1) continue;
        least = at.norm();
        nearest = &k;
      }
      if (nearest == nullptr || crosses(a, nearest->T_maplet_camera.se3.t, p)) continue;
      ++looks;
      blocked += crosses(b, T_b_a * nearest->T_maplet_camera.se3.t, T_b_a * p) ? 1 : 0;
    }
  }
  return looks == 0 ? 0.0 : static_cast<double>(blocked) / looks;
}

Closure Verifier::verify(const Maplet& a, const Maplet& b, const Transform<MapletA, MapletB>& guess,
                         double gate_m, double gate_rad, bool prior_holds,
                         Deadline deadline) noexcept {
  Closure out;
  const auto alignment = icap_.align(a, b, guess, gate_m, gate_rad, deadline);
  if (!alignment) {
    out.judgement = {Verdict::kReject, alignment.error().what};
    return out;
  }
  out.aligned = true;
  out.alignment = *alignment;
  out.judgement = judge(a, b, out, gate_m, gate_rad, prior_holds, deadline);
  return out;
}

Judgement Verifier::judge(const Maplet& a, const Maplet& b, Closure& closure, double gate_m,
                          double gate_rad, bool prior_holds, Deadline deadline) noexcept {
  const MapletAlignment& found = closure.alignment;
  if (found.chi2_per_dof > config_.reject_chi2_per_dof) {
    return {Verdict::kReject, "the planes do not fit"};
  }
  const Se3& T = found.T_a_b.se3;
  closure.conflict = std::max(blocked_sight(a, b, T), blocked_sight(b, a, T.inverse()));
  if (closure.conflict > config_.reject_conflict) {
    return {Verdict::kReject, "one saw through the other's surfaces"};
  }
  if (found.stop == Stop::kDeadline) return {Verdict::kUndecided, "no time left"};
  if (found.matches < config_.accept_matches) return {Verdict::kUndecided, "too few planes"};
  if (found.overlap < config_.accept_overlap) return {Verdict::kUndecided, "too little overlap"};
  if (found.chi2_per_dof > config_.accept_chi2_per_dof) {
    return {Verdict::kUndecided, "the planes fit badly"};
  }
  if (closure.conflict > config_.accept_conflict) {
    return {Verdict::kUndecided, "surfaces of one may block the other's view"};
  }
  if (found.free_axes.size() > (prior_holds ? 1U : 0U))
    return {Verdict::kUndecided, "the planes leave an axis free"};
  const MapletAlignment best = found;
  bool in_time = true;
  if (ambiguous(a, b, best, gate_m, gate_rad, deadline, in_time)) {
    return {Verdict::kUndecided, "another place fits nearly as well"};
  }
  if (!in_time) return {Verdict::kUndecided, "no time left"};
  return {Verdict::kAccept, "planes agree"};
}

// Starts again beside the best answer, as far as the gates reach.
bool Verifier::ambiguous(const Maplet& a, const Maplet& b, const MapletAlignment& best,
                         double gate_m, double gate_rad, Deadline deadline,
                         bool& in_time) noexcept {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      if (deadline.expired()) {
        in_time = false;
        return false;
      }
      Vector6d step = Vector6d::Zero();
      step[axis] = side * gate_m;
      const Transform<MapletA, MapletB> start{best.T_a_b.se3 * Se3::exp(step)};
      const auto other = icap_.align(a, b, start, 0.6 * gate_m, 0.6 * gate_rad, deadline);
      if (other && differ(best, other->T_a_b.se3) && score(*other) > kNearlyAsGood * score(best)) {
        return true;
      }
    }
  }
  return false;
}

}  // namespace maplet
