// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What others see of the skeleton.
#include <algorithm>

#include "core/skeleton/skeleton.hpp"

namespace maplet {

const Se3* Skeleton::pose(const MapletKey& key) const noexcept {
  const int node = find(key);
  return node < 0 ? nullptr : &solver_.graph().node(node).pose;
}

std::optional<Skeleton::Standing> Skeleton::standing(const MapletKey& key) const noexcept {
  Place at{};
  if (!place(key, at)) return {};
  return Standing{keys_[solver_.group(at.node)],
                  solver_.graph().node(at.node).pose * at.from_node.T};
}

const Se3* Skeleton::point(const MapletKey& key) const noexcept {
  const int node = find(key, true);
  return node < 0 || solver_.group(node) == node ? nullptr : &solver_.graph().node(node).pose;
}

MapletKey Skeleton::gauge(const MapletKey& key) const noexcept {
  return keys_[solver_.group(find(key))];
}

bool Skeleton::covariance(const MapletKey& a, const MapletKey& b, Matrix6d& out) noexcept {
  const int from = find(a);
  const int to = find(b);
  if (from < 0 || to < 0 || from == to || solver_.group(from) != solver_.group(to)) return false;
  solver_.flush();
  if (!judge_.marginals().known(from, to)) return false;
  out = judge_.marginals().of(from, to);
  return true;
}

Skeleton::NodeView Skeleton::node(int index) const noexcept {
  const int node = nodes_[index];
  return {keys_[node], keys_[solver_.group(node)], solver_.graph().node(node).pose};
}

Skeleton::FactorView Skeleton::factor(int index) const noexcept {
  const int factor = factors_[index];
  const Factor<SpatialSpace>& f = solver_.graph().factor(factor);
  const Provenance& p = provenance_[factor];
  const bool waits =
      p.kind == DeltaPose::Kind::kClosure && judge_.state(factor) == ClosureState::kNone;
  return {p.kind,
          keys_[f.a],
          keys_[f.b],
          p.stamp_a,
          p.stamp_b,
          f.z,
          unpack<SpatialSpace>(f.information),
          f.e,
          f.chi2,
          f.state.active ? f.weight : 0.0,
          waits ? ClosureState::kWaiting : judge_.state(factor)};
}

Skeleton::Way Skeleton::way(const MapletKey& from, const MapletKey& to,
                            std::span<MapletKey> maplets) noexcept {
  const int first = find(from);
  const int last = find(to);
  if (first < 0 || last < 0) return {};
  const auto path = paths_.shortest(solver_.graph(), first, last,
                                    order_.first(std::min(order_.size(), maplets.size())));
  for (int k = 0; k < path.count; ++k) maplets[k] = keys_[order_[k]];
  return {path.count, path.length_m};
}

SkeletonCounters Skeleton::counters() const noexcept {
  SkeletonCounters out = counters_;
  out.damped_pivots = solver_.elimination().damped_pivots();
  out.overflows = solver_.overflows();
  out.condensed = condenser_.nodes_gone();
  out.dropped = condenser_.factors_dropped();
  return out;
}

}  // namespace maplet
