// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/skeleton/space.hpp"

namespace maplet {

/// What a factor says about its nodes.
enum class FactorKind : std::uint8_t {
  kBetween,  ///< the relative pose of a and b
  kPrior,    ///< the pose of a; b is kNone
  kRange,    ///< how far b is from a
  kBearing,  ///< in which direction b is, seen from a
  kRangeBearing,
  kPosition,  ///< where b is in a's frame
};

/// Where a factor stands with the factorisation (docs/math/skeleton.md, section 3).
struct FactorState {
  bool active = false;      ///< counts in the objective
  bool integrated = false;  ///< its Hessian, as linearised at rel_lin and weight_lin, is eliminated
  bool dirty = false;       ///< waits to be eliminated anew
  bool in_job = false;      ///< part of the elimination under way
  bool evaluated = false;   ///< its error and gradient are the estimate's, or it is queued
  bool queued = false;      ///< waits to be evaluated
  bool stale = false;       ///< found worth linearising anew
  bool retired = false;     ///< to be freed: counts no more
  bool aside = false;       ///< would count, if there were room for its elimination
};

/// A measurement between two nodes, and its last linearisation.
template <class Space>
struct Factor {
  using Pose = typename Space::Pose;
  static constexpr int kDim = Space::kDim;
  static constexpr int kPacked = kDim * (kDim + 1) / 2;

  FactorKind kind = FactorKind::kBetween;
  FactorState state;
  int a = -1;
  int b = -1;
  std::array<int, 2> next{-1, -1};            ///< next incidence of a, of b: 2 * factor + side
  Pose z;                                     ///< the measured T_a_b; a sight as make_sight has it
  std::array<double, kPacked> information{};  ///< lower triangle, row by row
  double stiffness = 0.0;                     ///< largest information along one axis
  double weight = 1.0;                        ///< robust scale of the information, 0..1
  Pose rel_lin;                               ///< T_a_b that the factorisation was made with
  double weight_lin = 0.0;
  typename Space::Tangent e = Space::Tangent::Zero();  ///< error at the present estimate
  double chi2 = 0.0;                                   ///< unweighted e^T information e
  double counted = 0.0;  ///< its share of the objective as summed so far: weight * chi2
  typename Space::Tangent gradient_a = Space::Tangent::Zero();  ///< its share, as summed so far
  typename Space::Tangent gradient_b = Space::Tangent::Zero();
};

/// Who is the gauge where groups meet: the lowest.
struct Seniority {
  std::uint64_t high = 0;
  std::uint64_t low = 0;
  friend auto operator<=>(const Seniority&, const Seniority&) = default;
};

template <class Space>
struct Node {
  typename Space::Pose pose;
  /// At the stepper's reference; of a node that waits for elimination: in the frame of the node it
  /// hangs from.
  typename Space::Pose backup;
  Seniority seniority;
  int first_incidence = -1;  ///< 2 * factor + side
  int group = -1;            ///< the group's gauge node
  double anchor = 0.0;       ///< information that holds a gauge node where it is
  int priors = 0;            ///< of a gauge node: priors that hold the group, in its place
  int hung_from = -1;        ///< factor that placed it, until it is eliminated
  std::int64_t arrival = 0;  ///< counts
  bool used = false;
  bool keep = false;     ///< not to be taken out when room is wanted
  bool retired = false;  ///< to be freed
  bool point = false;    ///< a place without an orientation: only its position is estimated
};

template <class Space>
[[nodiscard]] typename Space::Block unpack(
    const std::array<double, Factor<Space>::kPacked>& packed) noexcept {
  typename Space::Block full;
  int k = 0;
  for (int r = 0; r < Space::kDim; ++r)
    for (int c = 0; c <= r; ++c) full(r, c) = full(c, r) = packed[k++];
  return full;
}

/// Nodes and factors in fixed arrays, each with a free list; incidences as linked lists.
///
/// Memory   two arrays in the arena, sized once.
/// Time     O(1), removing a factor O(degree of its nodes).
template <class Space>
class Graph {
 public:
  static constexpr int kNone = -1;

  Graph(int max_nodes, int max_factors, Arena& arena)
      : nodes_{arena.make_array<Node<Space>>(max_nodes, "skeleton/nodes")},
        factors_{arena.make_array<Factor<Space>>(max_factors, "skeleton/factors")} {}

  [[nodiscard]] bool nodes_full() const noexcept {
    return free_node_ == kNone && node_end_ == static_cast<int>(nodes_.size());
  }
  [[nodiscard]] bool factors_full() const noexcept {
    return free_factor_ == kNone && factor_end_ == static_cast<int>(factors_.size());
  }
  /// @pre !nodes_full()
  int add_node(const typename Space::Pose& pose) noexcept;
  /// @pre !factors_full(), no factor touches it
  void remove_node(int node) noexcept;
  /// @pre !factors_full()
  int add_factor(const Factor<Space>& factor) noexcept;
  void remove_factor(int factor) noexcept;

  [[nodiscard]] Node<Space>& node(int i) noexcept { return nodes_[i]; }
  [[nodiscard]] const Node<Space>& node(int i) const noexcept { return nodes_[i]; }
  [[nodiscard]] Factor<Space>& factor(int i) noexcept { return factors_[i]; }
  [[nodiscard]] const Factor<Space>& factor(int i) const noexcept { return factors_[i]; }
  /// One past the highest slot ever used; some below may be free.
  [[nodiscard]] int node_end() const noexcept { return node_end_; }
  [[nodiscard]] int factor_end() const noexcept { return factor_end_; }
  [[nodiscard]] int node_count() const noexcept { return node_count_; }
  [[nodiscard]] int factor_count() const noexcept { return factor_count_; }
  [[nodiscard]] int max_nodes() const noexcept { return static_cast<int>(nodes_.size()); }
  [[nodiscard]] int max_factors() const noexcept { return static_cast<int>(factors_.size()); }

  /// Calls visit(factor index, other node or kNone) for each factor at a node.
  template <class Visit>
  void for_each_incident(int node, Visit&& visit) const {
    for (int at = nodes_[node].first_incidence; at != kNone;) {
      const Factor<Space>& f = factors_[at >> 1];
      const int next = f.next[at & 1];
      visit(at >> 1, (at & 1) != 0 ? f.a : f.b);
      at = next;
    }
  }

 private:
  void unlink(int node, int incidence) noexcept;

  std::span<Node<Space>> nodes_;
  std::span<Factor<Space>> factors_;
  int node_end_ = 0;
  int factor_end_ = 0;
  int node_count_ = 0;
  int factor_count_ = 0;
  int free_node_ = kNone;    // linked through first_incidence
  int free_factor_ = kNone;  // linked through next[0]
};

extern template class Graph<PlanarSpace>;
extern template class Graph<SpatialSpace>;

}  // namespace maplet
