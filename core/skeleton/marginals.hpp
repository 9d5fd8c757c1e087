// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/skeleton/elimination.hpp"
#include "core/skeleton/graph.hpp"

namespace maplet {

/// Covariances on demand, from the factor at hand: J Sigma J^T for any J on one
/// or two nodes costs a forward solve along their paths to the root, nothing
/// else.
///
/// Memory   two blocks and a dozen bytes a node, from the arena.
/// Time     O(blocks of the columns on the two paths).
/// Math     docs/math/skeleton.md, eq. 15.
template <class Space>
class Marginals {
 public:
  static constexpr int kNone = -1;
  using Tangent = typename Space::Tangent;
  using Block = typename Space::Block;

  Marginals(const Graph<Space> &graph, const Elimination<Space> &elimination, Arena &arena);

  /// Both nodes (b may be kNone) are in the factor.
  [[nodiscard]] bool known(int a, int b) const noexcept;
  /// (J_a, J_b) Sigma (J_a, J_b)^T; b may be kNone. It stays at hand in `slot`
  /// for cross().
  /// @pre known(a, b)
  [[nodiscard]] Block project(int a, const Block &by_a, int b, const Block &by_b,
                              int slot = 0) noexcept;
  /// Cross covariance of what slots 1 and 0 hold: (J Sigma J'^T), slot 1 first.
  [[nodiscard]] Block cross() const noexcept;
  /// Covariance of a node's pose in its group's frame, tangent of the node.
  [[nodiscard]] Block of(int node) noexcept;
  /// Covariance of T_a_b, tangent of b.
  [[nodiscard]] Block of(int a, int b) noexcept;

 private:
  struct Row {
    std::array<Block, 2> x;
    std::array<std::int64_t, 2> mark{};
  };

  int collect(int node, int slot, int count) noexcept;

  const Graph<Space> &graph_;
  const Elimination<Space> &elimination_;
  std::span<Row> rows_;
  std::array<std::span<int>, 2> kept_;  ///< path of each slot
  std::array<int, 2> kept_count_{};
  std::array<std::int64_t, 2> stamp_{};
};

extern template class Marginals<PlanarSpace>;
extern template class Marginals<SpatialSpace>;

}  // namespace maplet
