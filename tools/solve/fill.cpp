// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/solve/fill.hpp"

#include <numeric>
#include <vector>

#include "core/skeleton/ordering.hpp"

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
    Arena arena{std::size_t{1} << 36};
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

}  // namespace maplet::graphs
