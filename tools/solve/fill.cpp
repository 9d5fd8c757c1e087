// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/solve/fill.hpp"

#include <algorithm>
#include <numeric>
#include <unordered_map>
#include <vector>

#include "core/skeleton/ordering.hpp"
#include "tools/solve/roomy_arena.hpp"

namespace maplet::graphs {

int factor_blocks(int nodes, std::span<const std::pair<int, int>> edges) {
  std::vector<std::vector<int>> neighbours(static_cast<std::size_t>(nodes));
  for (const auto& [a, b] : edges) {
    neighbours[static_cast<std::size_t>(a)].push_back(b);
    neighbours[static_cast<std::size_t>(b)].push_back(a);
  }
  std::vector<int> all(static_cast<std::size_t>(nodes));
  std::iota(all.begin(), all.end(), 0);
  for (int room = 64 * nodes;; room *= 4) {
    const auto room_for_all = roomy_arena(std::uint64_t{1} << 36);
    Arena& arena = *room_for_all;
    const std::span<ColumnSlot> slots =
        arena.make_array<ColumnSlot>(static_cast<std::size_t>(room), "solve/fill");
    Ordering ordering{nodes, std::max(1, static_cast<int>(edges.size())), slots, arena};
    ordering.clear();
    for (const int i : all) ordering.add_variable(i, false);
    for (const int i : all) {
      ordering.begin_edges(i);
      for (const int j : neighbours[static_cast<std::size_t>(i)]) ordering.add_edge(i, j);
    }
    ordering.ready(all);
    int used = 0;
    while (ordering.remaining() > 0) {
      const int length = ordering.eliminate(ordering.pick(), used, room - used);
      if (length == Ordering::kNone) break;
      used += length;
    }
    if (ordering.remaining() == 0) return used;
  }
}

namespace {

int blocks_wanted(const GraphFile& file, std::span<const Item> items, bool in_time) {
  std::unordered_map<std::uint64_t, int> index;
  std::vector<std::pair<int, int>> pairs;
  const auto of = [&](std::uint64_t id) {
    return index.try_emplace(id, static_cast<int>(index.size())).first->second;
  };
  for (const Item& item : items)
    pairs.emplace_back(of(file.edges[item.edge].a), of(file.edges[item.edge].b));
  const int fill = factor_blocks(static_cast<int>(index.size()), pairs);
  // The old factor and a new one beside it; in space, where blocks are most of the memory, a new
  // one of everything first throws the old one out, unless that has to serve meanwhile.
  return (file.planar || in_time ? 9 * fill : 7 * fill) / 4 + 1024;
}

}  // namespace

PoseGraphLimits limits_for(const GraphFile& file, std::span<const Item> items, std::size_t nodes,
                           int max_nodes, bool in_time) {
  const int all = std::max<int>(2, static_cast<int>(nodes));
  const int factors = std::max<int>(1, static_cast<int>(items.size()));
  if (max_nodes == 0 || max_nodes >= all)
    return {all, factors, blocks_wanted(file, items, in_time)};
  PoseGraphLimits limits;
  limits.max_nodes = std::max(kLeastNodes, max_nodes);
  // The file's own share of factors, and what a batch of contractions needs for a while.
  const double share = std::max(1.2, static_cast<double>(factors) / all);
  limits.max_factors = static_cast<int>(1.5 * share * limits.max_nodes) + 64;
  limits.max_blocks =
      std::min(limits.max_nodes * (limits.max_nodes + 1), 24 * limits.max_nodes + 1024);
  return limits;
}

}  // namespace maplet::graphs
