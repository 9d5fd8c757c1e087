// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/marginals.hpp"

#include <array>

#include "core/skeleton/block_kernels.hpp"
#include "core/skeleton/linearise.hpp"

namespace maplet {

template <class Space>
Marginals<Space>::Marginals(const Graph<Space> &graph, const Elimination<Space> &elimination,
                            Arena &arena)
    : graph_{graph},
      elimination_{elimination},
      rows_{arena.make_array<Row>(graph.max_nodes(), "skeleton/marginals")},
      kept_{arena.make_array<int>(graph.max_nodes(), "skeleton/marginals"),
            arena.make_array<int>(graph.max_nodes(), "skeleton/marginals")} {}

template <class Space>
bool Marginals<Space>::known(int a, int b) const noexcept {
  return elimination_.contains(a) && (b == kNone || elimination_.contains(b));
}

template <class Space>
int Marginals<Space>::collect(int node, int slot, int count) noexcept {
  while (node != kNone && rows_[node].mark[slot] != stamp_[slot]) {
    rows_[node].mark[slot] = stamp_[slot];
    rows_[node].x[slot].setZero();
    kept_[slot][count++] = node;
    node = elimination_.parent(node);
  }
  return count;
}

template <class Space>
auto Marginals<Space>::project(int a, const Block &by_a, int b, const Block &by_b,
                               int slot) noexcept -> Block {
  ++stamp_[slot];
  const int of_a = collect(a, slot, 0);
  const int count = b != kNone ? collect(b, slot, of_a) : of_a;
  kept_count_[slot] = count;
  rows_[a].x[slot] += by_a.transpose();
  if (b != kNone) rows_[b].x[slot] += by_b.transpose();
  const auto &pool = elimination_.pool();
  constexpr int kDim = Space::kDim;
  std::array<double, kDim * kDim + 1> sum{};  // one in reserve: block_kernels.hpp
  std::array<double, kDim * kDim + 1> turned{};
  // Children first: what only b reaches, then the path of a.
  for (int i = 0; i < count; ++i) {
    const int node = kept_[slot][i < count - of_a ? of_a + i : i - (count - of_a)];
    Block &x = rows_[node].x[slot];
    const int start = pool.start(node);
    for (int k = 0; k < kDim; ++k) block::solve_lower<kDim>(pool.block(start), x.col(k).data());
    Eigen::Map<Block>{turned.data()} = x.transpose();
    block::add_product<kDim>(sum.data(), turned.data(), turned.data());
    for (int s = start + 1; s < start + pool.length(node); ++s)
      block::subtract_product<kDim>(rows_[pool.slot(s).row].x[slot].data(), pool.block(s),
                                    turned.data());
  }
  return Eigen::Map<const Block>{sum.data()};
}

template <class Space>
auto Marginals<Space>::cross() const noexcept -> Block {
  Block sum = Block::Zero();
  for (int k = 0; k < kept_count_[1]; ++k) {
    const Row &row = rows_[kept_[1][k]];
    if (row.mark[0] == stamp_[0]) sum.noalias() += row.x[1].transpose() * row.x[0];
  }
  return sum;
}

template <class Space>
auto Marginals<Space>::of(int node) noexcept -> Block {
  return project(node, Block::Identity(), kNone, Block::Zero());
}

template <class Space>
auto Marginals<Space>::of(int a, int b) noexcept -> Block {
  const auto rel = Space::between(graph_.node(a).pose, graph_.node(b).pose);
  Block by_a, by_b;
  Space::jacobians(rel, rel, Tangent::Zero(), by_a, by_b);
  return project(a, by_a, b, by_b);
}

template class Marginals<PlanarSpace>;
template class Marginals<SpatialSpace>;

}  // namespace maplet
