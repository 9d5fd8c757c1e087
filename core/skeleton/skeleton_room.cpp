// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The skeleton at its limits, and what it sees of places rather than relates: sights.
#include <algorithm>

#include "core/skeleton/skeleton.hpp"

namespace maplet {

bool Skeleton::make_room(int nodes, int factors) noexcept {
  if (condenser_.has_room(nodes, factors)) return true;
  if (!config_.condense) return false;
  (void)condenser_.make_room(nodes, factors);  // what went has gone, also where it is not enough
  for (const auto& c : condenser_.contractions()) {
    if (c.hub >= 0) forwarding_.put(keys_[c.node], keys_[c.hub], {c.T_hub_node, c.covariance});
    chains_.forget(c.node);
    const auto end = nodes_.begin() + node_count_;
    node_count_ = static_cast<int>(std::remove(nodes_.begin(), end, c.node) - nodes_.begin());
  }
  condenser_.finish();
  solver_.take_freed([&](int factor) {
    judge_.forget(factor);
    finder_.forget(factor);
    const auto undecided = std::find(undecided_.begin(), undecided_.end(), factor);
    if (undecided != undecided_.end()) undecided_.erase(undecided);
    provenance_[factor] = {};
  });
  // What is left, and what the condenser made of the rest.
  std::fill(table_.begin(), table_.end(), 0);
  const auto& graph = solver_.graph();
  for (int i = 0; i < graph.node_end(); ++i)
    if (graph.node(i).used) enter(keys_[i], i);
  factor_count_ = 0;
  for (int i = 0; i < graph.factor_end(); ++i)
    if (graph.factor(i).a >= 0 && graph.factor(i).kind == FactorKind::kBetween)
      factors_[factor_count_++] = i;
  return condenser_.has_room(nodes, factors);
}

Added Skeleton::add(const Sight& sight, Deadline deadline) noexcept {
  const bool ranges = sight.kind != FactorKind::kBearing;
  const bool bears = sight.kind != FactorKind::kRange;
  if (!measure::is_sight(sight.kind) || (!sight.point && sight.a == sight.b) ||
      (ranges && !(sight.range_m > 0.0 && sight.range_sigma_m > 0.0 &&
                   std::isfinite(sight.range_m + sight.range_sigma_m))) ||
      (bears && !(std::abs(sight.direction.norm() - 1.0) < 1e-3 && sight.bearing_sigma_rad > 0.0 &&
                  std::isfinite(sight.bearing_sigma_rad)))) {
    ++counters_.bad_measurements;
    return Added::kBadMeasurement;
  }
  const int a = find(sight.a);
  const bool unknown = a < 0 || (!sight.point && find(sight.b) < 0);
  if (unknown) {
    if (forwarding_.find(sight.a) != nullptr ||
        (!sight.point && forwarding_.find(sight.b) != nullptr)) {
      ++counters_.gone;
      return Added::kGone;
    }
    if (full(waiting_)) {
      waiting_.erase(waiting_.begin());
      ++counters_.waiting_dropped;
    }
    waiting_.push_back(sight);
    return Added::kWaiting;
  }
  const bool fresh = sight.point && find(sight.b, true) < 0;
  if (!make_room(fresh ? 1 : 0, 1)) {
    ++counters_.factors_full;
    return Added::kFactorsFull;
  }
  const Added added = find(sight.a) < 0 ? Added::kGone : link(sight, find(sight.a));
  canonical_ = false;
  report_ = update(deadline);
  return added;
}

Added Skeleton::link(const Sight& sight, int a) noexcept {
  int b = find(sight.b, sight.point);
  if (b < 0 && !sight.point) return Added::kGone;
  const bool tells = sight.kind == FactorKind::kRangeBearing || sight.kind == FactorKind::kPosition;
  const Eigen::Vector3d at = sight.range_m * sight.direction;
  if (b < 0) {
    b = tells ? solver_.add_point(a, measure::make_position(at)) : solver_.add_point();
    keys_[b] = sight.b;
    enter(sight.b, b);
  }
  Matrix6d information = Matrix6d::Zero();
  const double range = 1.0 / (sight.range_sigma_m * sight.range_sigma_m);
  const double bearing = 1.0 / (sight.bearing_sigma_rad * sight.bearing_sigma_rad);
  Se3 z = measure::make_sight(sight.range_m, sight.direction, SpatialSpace{});
  if (sight.kind == FactorKind::kPosition) {
    z = measure::make_position(at);
    const Eigen::Matrix3d along = sight.direction * sight.direction.transpose();
    information.topLeftCorner<3, 3>() = range * along + bearing / (sight.range_m * sight.range_m) *
                                                            (Eigen::Matrix3d::Identity() - along);
  } else {
    if (sight.kind != FactorKind::kBearing) information(0, 0) = range;
    if (sight.kind != FactorKind::kRange) information.diagonal().segment<3>(1).setConstant(bearing);
  }
  const int factor = solver_.add_sight(sight.kind, a, b, z, information);
  provenance_[factor] = {};
  finder_.note(factor);
  return Added::kLinked;
}

// Maplets came: sights that waited for them are heard.
void Skeleton::hear_waiting() noexcept {
  for (std::size_t k = 0; k < waiting_.size();) {
    const Sight sight = waiting_[k];
    const int a = find(sight.a);
    if (a < 0 || (!sight.point && find(sight.b) < 0) || !condenser_.has_room(1, 1)) {
      ++k;
      continue;
    }
    waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(k));
    (void)link(sight, a);
  }
}

}  // namespace maplet
