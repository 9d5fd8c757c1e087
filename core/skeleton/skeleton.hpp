// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/base/field.hpp"
#include "core/base/static_vector.hpp"
#include "core/maplet/maplet.hpp"
#include "core/registration/delta_pose.hpp"
#include "core/skeleton/closure_judge.hpp"
#include "core/skeleton/closure_sets.hpp"
#include "core/skeleton/condenser.hpp"
#include "core/skeleton/forwarding.hpp"
#include "core/skeleton/frame_finder.hpp"
#include "core/skeleton/odometry_chains.hpp"
#include "core/skeleton/path_finder.hpp"
#include "core/skeleton/pose_graph.hpp"

namespace maplet {

/// Of a key, well mixed.
[[nodiscard]] std::uint64_t hash_of(const MapletKey& key) noexcept;

struct SkeletonConfig {
  int max_nodes = 1536;
  int max_factors = 6144;
  int blocks_per_node = 12;
  double closure_sigmas = 3.0;  ///< how much larger standard deviations are taken in the gate
  bool condense = true;         ///< at the limits; else what comes then is turned away

  static const std::span<const Field<SkeletonConfig>> kFields;
};

/// What became of a delta-pose or a sight.
enum class Added : std::uint8_t {
  kLinked,          ///< a factor now; new nodes with it where there were none
  kDuplicate,       ///< the same measurement of the same pair is in already
  kBadMeasurement,  ///< not finite, covariance not positive definite, or a == b
  kNodesFull,
  kFactorsFull,
  kWaiting,  ///< a sight of a maplet that nobody has told of yet
  kLoose,    ///< a consecutive one that holds nothing (loose()): its maplets are nodes now
  kGone,     ///< of a maplet that was taken out for want of room and is forgotten
};

/// What has been turned away or had to give since the start.
struct SkeletonCounters {
  std::uint64_t duplicates = 0;
  std::uint64_t bad_measurements = 0;
  std::uint64_t nodes_full = 0;
  std::uint64_t factors_full = 0;
  std::uint64_t joined_groups = 0;
  std::uint64_t damped_pivots = 0;
  std::uint64_t overflows = 0;        ///< factors set aside: no room for their elimination
  std::uint64_t condensed = 0;        ///< maplets taken out for want of room
  std::uint64_t dropped = 0;          ///< factors, for want of room
  std::uint64_t gone = 0;             ///< measurements at maplets that are forgotten
  std::uint64_t waiting_dropped = 0;  ///< sights that waited for their maplet in vain
};

/// How far, in which direction, or where b is as a sees it.
struct Sight {
  FactorKind kind = FactorKind::kRange;  ///< any but kBetween, kPrior
  MapletKey a;
  MapletKey b;         ///< a maplet, or a point by its own number
  bool point = false;  ///< b is a place without an orientation: a beacon, a landmark
  double range_m = 0.0;
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  ///< unit, a's frame
  double range_sigma_m = 0.0;
  double bearing_sigma_rad = 0.0;
  Stamp stamp{};
};

/// The global pose graph of maplet origins, of all agents.
///
/// Nodes are maplets, factors are delta-poses. Agents without a connection stand side by side, each
/// group with its own first node (lowest key) as gauge at the identity. Closures are judged by what
/// the graph knows without them; a verdict can be set by hand, either way. At its limits the graph
/// is condensed: Condenser, Forwarding.
///
/// Memory   fixed by the configuration, from the arena; no heap.
/// Time     add O(1) (O(nodes) when it joins two groups); update until its deadline; settle is a
///          batch solution, for when nothing else is to be done.
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
  /// Takes a sight in. A point of which only ranges are known, or an agent that nothing else
  /// relates to the others, is placed once enough of them tell where.
  Added add(const Sight& sight, Deadline deadline) noexcept;
  /// Works on whatever is left; kConverged when nothing is.
  SolveReport update(Deadline deadline) noexcept;
  /// Nothing is queued: everything once more from the start, so that the result depends on the set
  /// of records and the limits alone. Closures are judged in the order of their keys, from where
  /// odometry puts the maplets; then it iterates to a step below 1e-9.
  /// @return whether it came to its end
  bool settle(Deadline deadline) noexcept;
  /// settle() has come to its end, and nothing has been added since.
  [[nodiscard]] bool canonical() const noexcept { return canonical_; }

  /// T_world_maplet at the present estimate, or nullptr for a maplet it has not heard of.
  [[nodiscard]] const Se3* pose(const MapletKey& key) const noexcept;
  /// Where a maplet stands, also one that was taken out for want of room: by the node that stands
  /// for it. Two are related when their gauges are equal. Nothing for one it knows nothing of.
  struct Standing {
    MapletKey gauge;
    Se3 T_world_maplet;
  };
  [[nodiscard]] std::optional<Standing> standing(const MapletKey& key) const noexcept;
  /// Where a point is, in the world of the group that saw it; nullptr before that is known.
  [[nodiscard]] const Se3* point(const MapletKey& key) const noexcept;
  /// The gauge of a maplet's group; two maplets are related when theirs are equal.
  /// @pre pose(key) != nullptr
  [[nodiscard]] MapletKey gauge(const MapletKey& key) const noexcept;
  /// Covariance of T_a_b (m^2, rad^2; tangent of b). @return false when nothing relates the two yet
  [[nodiscard]] bool covariance(const MapletKey& a, const MapletKey& b, Matrix6d& out) noexcept;
  /// Sum of weight * e^T information e.
  [[nodiscard]] double chi2() const noexcept { return report_.chi2; }
  [[nodiscard]] Stop stop() const noexcept { return report_.stop; }
  /// Nothing waits and no step gains any more: update() would change nothing.
  [[nodiscard]] bool settled() const noexcept { return undecided_.empty() && solver_.settled(); }
  /// The same for the same set of records, in whatever order they came.
  [[nodiscard]] std::uint64_t records_digest() const noexcept { return digest_; }

  /// Nodes in order of arrival: index 0 .. node_count() - 1.
  struct NodeView {
    MapletKey key;
    MapletKey gauge;
    Se3 T_world_maplet;
  };
  [[nodiscard]] int node_count() const noexcept { return static_cast<int>(node_count_); }
  [[nodiscard]] NodeView node(int index) const noexcept;

  /// Factors between maplets in order of arrival: index 0 .. factor_count() - 1.
  struct FactorView {
    DeltaPose::Kind kind;
    MapletKey a;
    MapletKey b;
    Stamp stamp_a{};
    Stamp stamp_b{};
    Se3 T_a_b;             ///< as measured
    Matrix6d information;  ///< of log(T_a_b^-1 T), tangent of b
    Vector6d residual;     ///< log(T_a_b^-1 T_a_b(estimate)), tangent of b
    double chi2;           ///< residual^T information residual, as last evaluated
    double weight;         ///< robust weight, 0 = rejected .. 1
    ClosureState verdict;  ///< kNone: odometry
  };
  [[nodiscard]] int factor_count() const noexcept { return factor_count_; }
  [[nodiscard]] FactorView factor(int index) const noexcept;

  /// A verdict by hand: the closures between two maplets count, or do not, whatever the judge
  /// thinks. Merges that rested on one that is rejected come apart. @return how many there are
  int decide(const MapletKey& a, const MapletKey& b, bool accept, Deadline deadline) noexcept;

  /// The shortest way along the skeleton, both ends included. @return 0: there is none, or no room
  struct Way {
    int count = 0;
    double length_m = 0.0;
  };
  [[nodiscard]] Way way(const MapletKey& from, const MapletKey& to,
                        std::span<MapletKey> maplets) noexcept;

  [[nodiscard]] SkeletonCounters counters() const noexcept;

 private:
  static constexpr int kMostWaiting = 64;
  static constexpr int kMostCompared = 128;

  struct Provenance {
    DeltaPose::Kind kind = DeltaPose::Kind::kConsecutive;
    bool record = false;  ///< as somebody told it; else made by the condenser
    Stamp stamp_a{};
    Stamp stamp_b{};
  };
  struct Place {
    int node;
    Relation<SpatialSpace> from_node;  ///< T_node_maplet
  };

  [[nodiscard]] int find(const MapletKey& key, bool point = false) const noexcept;
  int insert(const MapletKey& key, const Se3& pose) noexcept;
  void enter(const MapletKey& key, int node) noexcept;
  void remove(int node) noexcept;
  [[nodiscard]] bool known(const DeltaPose& delta, int a, int b) const noexcept;
  [[nodiscard]] std::size_t bucket(const MapletKey& key, bool point) const noexcept;
  [[nodiscard]] bool place(const MapletKey& key, Place& out) const noexcept;
  [[nodiscard]] bool make_room(int nodes, int factors) noexcept;
  void take_factor(int factor, const Provenance& provenance) noexcept;
  Added link(const Sight& sight, int a) noexcept;
  void hear_waiting() noexcept;
  void keep_newest(int node) noexcept;
  void decide_waiting(Deadline deadline) noexcept;
  [[nodiscard]] bool torn(int factor) const noexcept;
  // skeleton_settle.cpp
  void sort_by_key() noexcept;
  void start_canonically() noexcept;
  void judge_all() noexcept;

  SkeletonConfig config_;
  PoseGraph<SpatialSpace> solver_;
  ClosureJudge<SpatialSpace> judge_;
  FrameFinder<SpatialSpace> finder_;
  Condenser<SpatialSpace> condenser_;
  Forwarding<SpatialSpace, MapletKey> forwarding_;
  PathFinder<SpatialSpace> paths_;
  OdometryChains<SpatialSpace> chains_;
  ClosureSets<SpatialSpace> sets_;
  std::span<MapletKey> keys_;         ///< by node
  std::span<Provenance> provenance_;  ///< by factor
  std::span<int> table_;              ///< open addressing: node + 1, 0 = empty
  std::span<int> nodes_;              ///< maplets in order of arrival
  std::span<int> factors_;            ///< between maplets, in order of arrival
  std::span<int> order_;              ///< settle's: factors by key; a way's nodes
  std::span<bool> placed_;            ///< settle's: nodes
  std::span<bool> late_;              ///< settle's: factors
  StaticVector<Sight, kMostWaiting> waiting_;
  StaticVector<int, kMostWaiting> undecided_;  ///< closures that nobody has judged yet
  StaticVector<int, 64> newest_;               ///< of each agent: stays
  int node_count_ = 0;
  int factor_count_ = 0;
  std::uint64_t digest_ = 0;
  bool canonical_ = false;
  SolveReport report_;
  SkeletonCounters counters_;
};

}  // namespace maplet
