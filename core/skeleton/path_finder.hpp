// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/skeleton/graph.hpp"

namespace maplet {

/// The shortest way along the skeleton between two of its places: where somebody has gone before,
/// or places that overlap (the paper: the way to the exit).
///
/// Memory   twenty bytes a node, from the arena.
/// Time     O(factors log nodes), Dijkstra's; it stops at the goal.
/// Math     docs/math/skeleton.md, section 12.
template <class Space>
class PathFinder {
 public:
  PathFinder(int max_nodes, Arena& arena);

  struct Path {
    int count = 0;  ///< nodes written; 0: there is no way, or no room for it
    double length_m = 0.0;
  };
  /// Writes the nodes from `from` to `to`, both included. Factors that do not count are no way.
  [[nodiscard]] Path shortest(const Graph<Space>& graph, int from, int to,
                              std::span<int> nodes) noexcept;

 private:
  static constexpr int kNone = -1;

  void push(int node) noexcept;
  [[nodiscard]] int pop() noexcept;
  void up(int at) noexcept;

  std::span<double> length_;
  std::span<int> before_;
  std::span<int> place_;  ///< in the heap; kNone: not in it
  std::span<int> heap_;
  int heap_count_ = 0;
};

extern template class PathFinder<PlanarSpace>;
extern template class PathFinder<SpatialSpace>;

}  // namespace maplet
