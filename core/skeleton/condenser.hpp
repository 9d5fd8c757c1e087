// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/static_vector.hpp"
#include "core/skeleton/marginals.hpp"
#include "core/skeleton/pose_graph.hpp"

namespace maplet {

/// A node that was taken out, and the neighbour that stands for it.
template <class Space>
struct Contraction {
  int node = -1;
  int hub = -1;
  typename Space::Pose T_hub_node;
  typename Space::Block covariance;  ///< tangent of the node
};

/// Keeps a graph within its limits: takes out the nodes that say least, and the factors that the
/// others say already.
///
/// A node goes by contraction into its best known neighbour, the hub: factors from the hub to the
/// other neighbours take the place of its own, between-type all of them. A node on a chain loses
/// nothing by it; at a junction the new factors share the hub's noise, and each is widened so that
/// together they never claim more than what went (eq. 24). Nodes marked `keep`, gauges and points
/// stay.
///
/// Memory   four bytes a factor, twenty a node, a list of max_nodes / 16, from the arena.
/// Time     make_room: some O(factors) looks and one elimination, for a sixteenth of the limits at
///          a time; nothing while there is room.
/// Math     docs/math/skeleton.md, section 9.
template <class Space>
class Condenser {
 public:
  using Pose = typename Space::Pose;
  using Block = typename Space::Block;
  using Tangent = typename Space::Tangent;

  Condenser(PoseGraph<Space>& graph, Marginals<Space>& marginals, Arena& arena);

  [[nodiscard]] bool has_room(int nodes, int factors) const noexcept;
  /// Makes room for so many more. What went is in contractions(), and in the graph's retired
  /// factors, until finish(). @return false when nothing can go
  bool make_room(int nodes, int factors) noexcept;
  [[nodiscard]] std::span<const Contraction<Space>> contractions() const noexcept {
    return gone_.first(static_cast<std::size_t>(gone_count_));
  }
  /// Frees what make_room took out.
  void finish() noexcept;

  [[nodiscard]] std::uint64_t nodes_gone() const noexcept { return nodes_gone_; }
  /// Factors dropped: what they said is not in the graph any more, or was said by others.
  [[nodiscard]] std::uint64_t factors_dropped() const noexcept { return factors_dropped_; }

 private:
  static constexpr int kMostNeighbours = 24;  ///< a node with more of them stays

  struct Spoke {  // all that relates the node and one neighbour
    int other = -1;
    Pose z;  ///< T_node_other
    Block information;
  };
  using Star = StaticVector<Spoke, kMostNeighbours>;

  [[nodiscard]] bool star_of(int node, Star& star) const noexcept;
  [[nodiscard]] static int hub_of(const Star& star, double& spread) noexcept;
  [[nodiscard]] int least_informative() const noexcept;
  void contract(int node) noexcept;
  void move_sight(const Factor<Space>& sight, int hub, const Pose& T_hub_node,
                  const Block& covariance) noexcept;
  void add_fused(int a, int b, Pose z, Block information) noexcept;
  void measure_leverage() noexcept;
  int thin_out(int wanted) noexcept;
  [[nodiscard]] bool connected_without(int factor) noexcept;

  PoseGraph<Space>& graph_;
  Marginals<Space>& marginals_;
  std::span<Contraction<Space>> gone_;
  std::span<float> leverage_;  ///< of factors, 0..1: what the graph knows without one
  std::span<int> stack_;       ///< of the search for a way around
  std::span<std::int64_t> seen_;
  std::int64_t stamp_ = 0;
  int gone_count_ = 0;
  std::uint64_t nodes_gone_ = 0;
  std::uint64_t factors_dropped_ = 0;
};

extern template class Condenser<PlanarSpace>;
extern template class Condenser<SpatialSpace>;

}  // namespace maplet
