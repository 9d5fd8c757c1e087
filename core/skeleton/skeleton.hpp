// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/base/field.hpp"
#include "core/maplet/maplet.hpp"
#include "core/registration/delta_pose.hpp"
#include "core/skeleton/pose_graph.hpp"

namespace maplet {

struct SkeletonConfig {
  int max_nodes = 4096;
  int max_factors = 16384;
  int blocks_per_node = 24;

  static const std::span<const Field<SkeletonConfig>> kFields;
};

/// What became of a delta-pose.
enum class Added : std::uint8_t {
  kLinked,          ///< a factor now; new nodes with it where there were none
  kDuplicate,       ///< the same pair, kind and stamps are in already
  kBadMeasurement,  ///< not finite, covariance not positive definite, or a == b
  kNodesFull,
  kFactorsFull,
};

/// What has been turned away or had to give since the start.
struct SkeletonCounters {
  std::uint64_t duplicates = 0;
  std::uint64_t bad_measurements = 0;
  std::uint64_t nodes_full = 0;
  std::uint64_t factors_full = 0;
  std::uint64_t joined_groups = 0;
  std::uint64_t damped_pivots = 0;
  std::uint64_t overflows = 0;  ///< factors set aside: no room for their elimination
};

/// The global pose graph of maplet origins, of all agents.
///
/// Nodes are maplets, factors are delta-poses. Agents without a connection stand side by side, each
/// group with its own first node (lowest key) as gauge at the identity.
///
/// Memory   fixed by the configuration, from the arena; no heap.
/// Time     add O(1) (O(nodes) when it joins two groups); update until its deadline.
/// Threads  one at a time.
/// Math     docs/math/skeleton.md; the paper's section "Optimizing the Map Skeleton".
class Skeleton {
 public:
  Skeleton(const SkeletonConfig& config, Arena& arena);

  /// Takes a maplet in that nothing is known about yet: a group of its own.
  /// @return kLinked, kDuplicate when it is there already, kNodesFull
  Added add(const MapletKey& key) noexcept;
  /// Takes a delta-pose in, then works on the estimate until the deadline, as update() does.
  Added add(const DeltaPose& delta, Deadline deadline) noexcept;
  /// Works on whatever is left; kConverged when nothing is.
  SolveReport update(Deadline deadline) noexcept;

  /// T_world_maplet at the present estimate, or nullptr for a maplet it has not heard of.
  [[nodiscard]] const Se3* pose(const MapletKey& key) const noexcept;
  /// The gauge of a maplet's group; two maplets are related when theirs are equal.
  /// @pre pose(key) != nullptr
  [[nodiscard]] MapletKey gauge(const MapletKey& key) const noexcept;
  /// Sum of weight * e^T information e.
  [[nodiscard]] double chi2() const noexcept { return report_.chi2; }
  [[nodiscard]] Stop stop() const noexcept { return report_.stop; }
  /// Nothing waits and no step gains any more: update() would change nothing.
  [[nodiscard]] bool settled() const noexcept { return solver_.settled(); }

  /// Nodes in order of arrival: index 0 .. node_count() - 1.
  struct NodeView {
    MapletKey key;
    MapletKey gauge;
    Se3 T_world_maplet;
  };
  [[nodiscard]] int node_count() const noexcept { return node_count_; }
  [[nodiscard]] NodeView node(int index) const noexcept;

  /// Factors in order of arrival: index 0 .. factor_count() - 1.
  struct FactorView {
    DeltaPose::Kind kind;
    MapletKey a;
    MapletKey b;
    Se3 T_a_b;             ///< as measured
    Matrix6d information;  ///< of log(T_a_b^-1 T), tangent of b
    Vector6d residual;     ///< log(T_a_b^-1 T_a_b(estimate)), tangent of b
    double chi2;           ///< residual^T information residual, as last evaluated
    double weight;         ///< robust weight, 0 = rejected .. 1
  };
  [[nodiscard]] int factor_count() const noexcept { return factor_count_; }
  [[nodiscard]] FactorView factor(int index) const noexcept;

  [[nodiscard]] SkeletonCounters counters() const noexcept;

 private:
  struct Provenance {
    DeltaPose::Kind kind;
    Stamp stamp_a;
    Stamp stamp_b;
  };

  [[nodiscard]] int find(const MapletKey& key) const noexcept;
  int insert(const MapletKey& key, const Se3& pose) noexcept;
  [[nodiscard]] bool known(const DeltaPose& delta, int a, int b) const noexcept;
  [[nodiscard]] std::size_t bucket(const MapletKey& key) const noexcept;

  PoseGraph<SpatialSpace> solver_;
  std::span<MapletKey> keys_;         ///< by node
  std::span<Provenance> provenance_;  ///< by factor
  std::span<int> table_;              ///< open addressing: node + 1, 0 = empty
  int node_count_ = 0;
  int factor_count_ = 0;
  SolveReport report_;
  SkeletonCounters counters_;
};

}  // namespace maplet
