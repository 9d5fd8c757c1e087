// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/skeleton.hpp"

#include <Eigen/Cholesky>
#include <array>
#include <bit>

namespace maplet {

namespace {

constexpr std::array kTable = {
    Field<SkeletonConfig>{"max_nodes", &SkeletonConfig::max_nodes, 2, 1e6,
                          "Maplets the skeleton holds, of all agents"},
    Field<SkeletonConfig>{"max_factors", &SkeletonConfig::max_factors, 1, 1e7,
                          "Delta-poses the skeleton holds, of all agents"},
    Field<SkeletonConfig>{"blocks_per_node", &SkeletonConfig::blocks_per_node, 4, 1000,
                          "Blocks of the Cholesky factor for each node, on the average"},
};

// Information of a delta-pose. @return false when there is none
bool invert(const Matrix6d& covariance, Matrix6d& information) noexcept {
  if (!covariance.allFinite()) return false;
  const Eigen::LLT<Matrix6d> llt{covariance};
  if (llt.info() != Eigen::Success) return false;
  information = llt.solve(Matrix6d::Identity());
  return information.allFinite();
}

}  // namespace

const std::span<const Field<SkeletonConfig>> SkeletonConfig::kFields{kTable};

Skeleton::Skeleton(const SkeletonConfig& config, Arena& arena)
    : solver_{{config.max_nodes, config.max_factors, config.max_nodes * config.blocks_per_node},
              arena},
      keys_{arena.make_array<MapletKey>(config.max_nodes, "skeleton/keys")},
      provenance_{arena.make_array<Provenance>(config.max_factors, "skeleton/keys")},
      table_{arena.make_array<int>(std::bit_ceil(2 * static_cast<std::size_t>(config.max_nodes)),
                                   "skeleton/keys")} {}

std::size_t Skeleton::bucket(const MapletKey& key) const noexcept {
  std::uint64_t h = (std::uint64_t{key.epoch} << 32) | key.id;
  h ^= std::uint64_t{key.agent} * 0x9E3779B97F4A7C15u;
  h = (h ^ (h >> 30)) * 0xBF58476D1CE4E5B9u;  // splitmix64
  h = (h ^ (h >> 27)) * 0x94D049BB133111EBu;
  return static_cast<std::size_t>(h ^ (h >> 31)) & (table_.size() - 1);
}

int Skeleton::find(const MapletKey& key) const noexcept {
  for (std::size_t i = bucket(key);; i = (i + 1) & (table_.size() - 1)) {
    if (table_[i] == 0) return -1;
    if (keys_[table_[i] - 1] == key) return table_[i] - 1;
  }
}

int Skeleton::insert(const MapletKey& key, const Se3& pose) noexcept {
  const int node = solver_.add_node(pose, {(std::uint64_t{key.agent} << 32) | key.epoch, key.id});
  keys_[node] = key;
  std::size_t i = bucket(key);
  while (table_[i] != 0) i = (i + 1) & (table_.size() - 1);
  table_[i] = node + 1;
  ++node_count_;
  return node;
}

bool Skeleton::known(const DeltaPose& delta, int a, int b) const noexcept {
  bool found = false;
  solver_.graph().for_each_incident(a, [&](int index, int other) {
    const Provenance& p = provenance_[index];
    found |= other == b && solver_.graph().factor(index).a == a && p.kind == delta.kind &&
             p.stamp_a == delta.stamp_a && p.stamp_b == delta.stamp_b;
  });
  return found;
}

Added Skeleton::add(const MapletKey& key) noexcept {
  if (find(key) >= 0) return Added::kDuplicate;
  if (solver_.graph().nodes_full()) {
    ++counters_.nodes_full;
    return Added::kNodesFull;
  }
  insert(key, Se3{});
  return Added::kLinked;
}

Added Skeleton::add(const DeltaPose& delta, Deadline deadline) noexcept {
  Matrix6d information;
  if (delta.a == delta.b || !SpatialSpace::finite(delta.T_a_b.se3) ||
      delta.T_a_b.se3.q.norm() < 0.5 || !invert(delta.covariance, information)) {
    ++counters_.bad_measurements;
    return Added::kBadMeasurement;
  }
  int a = find(delta.a);
  int b = find(delta.b);
  if (a >= 0 && b >= 0 && known(delta, a, b)) {
    ++counters_.duplicates;
    return Added::kDuplicate;
  }
  if (solver_.graph().factors_full()) {
    ++counters_.factors_full;
    return Added::kFactorsFull;
  }
  if (node_count_ + (a < 0 ? 1 : 0) + (b < 0 ? 1 : 0) > solver_.graph().max_nodes()) {
    ++counters_.nodes_full;
    return Added::kNodesFull;
  }
  if (a >= 0 && b >= 0 && solver_.group(a) != solver_.group(b)) ++counters_.joined_groups;
  Se3 z = delta.T_a_b.se3;
  z.q.normalize();
  if (a < 0) a = insert(delta.a, Se3{});
  if (b < 0) b = insert(delta.b, Se3{});
  const int factor = solver_.add_between(a, b, z, information);
  provenance_[factor] = {delta.kind, delta.stamp_a, delta.stamp_b};
  ++factor_count_;
  report_ = solver_.update(deadline);
  return Added::kLinked;
}

SolveReport Skeleton::update(Deadline deadline) noexcept {
  return report_ = solver_.update(deadline);
}

const Se3* Skeleton::pose(const MapletKey& key) const noexcept {
  const int node = find(key);
  return node < 0 ? nullptr : &solver_.graph().node(node).pose;
}

MapletKey Skeleton::gauge(const MapletKey& key) const noexcept {
  return keys_[solver_.group(find(key))];
}

Skeleton::NodeView Skeleton::node(int index) const noexcept {
  return {keys_[index], keys_[solver_.group(index)], solver_.graph().node(index).pose};
}

Skeleton::FactorView Skeleton::factor(int index) const noexcept {
  const Factor<SpatialSpace>& f = solver_.graph().factor(index);
  return {provenance_[index].kind,
          keys_[f.a],
          keys_[f.b],
          f.z,
          unpack<SpatialSpace>(f.information),
          f.e,
          f.chi2,
          f.weight};
}

SkeletonCounters Skeleton::counters() const noexcept {
  SkeletonCounters out = counters_;
  out.damped_pivots = solver_.elimination().damped_pivots();
  out.overflows = solver_.overflows();
  return out;
}

}  // namespace maplet
