// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/path_finder.hpp"

#include <algorithm>
#include <limits>

#include "core/skeleton/measure.hpp"

namespace maplet {

template <class Space>
PathFinder<Space>::PathFinder(int max_nodes, Arena& arena)
    : length_{arena.make_array<double>(max_nodes, "skeleton/paths")},
      before_{arena.make_array<int>(max_nodes, "skeleton/paths")},
      place_{arena.make_array<int>(max_nodes, "skeleton/paths")},
      heap_{arena.make_array<int>(max_nodes, "skeleton/paths")} {}

template <class Space>
void PathFinder<Space>::up(int at) noexcept {
  const int node = heap_[at];
  while (at > 0 && length_[node] < length_[heap_[(at - 1) / 2]]) {
    heap_[at] = heap_[(at - 1) / 2];
    place_[heap_[at]] = at;
    at = (at - 1) / 2;
  }
  heap_[at] = node;
  place_[node] = at;
}

template <class Space>
void PathFinder<Space>::push(int node) noexcept {
  if (place_[node] == kNone) {
    place_[node] = heap_count_;
    heap_[heap_count_++] = node;
  }
  up(place_[node]);
}

template <class Space>
int PathFinder<Space>::pop() noexcept {
  const int top = heap_[0];
  place_[top] = kNone;
  const int last = heap_[--heap_count_];
  if (heap_count_ == 0) return top;
  int at = 0;
  for (;;) {
    int child = 2 * at + 1;
    if (child >= heap_count_) break;
    if (child + 1 < heap_count_ && length_[heap_[child + 1]] < length_[heap_[child]]) ++child;
    if (!(length_[heap_[child]] < length_[last])) break;
    heap_[at] = heap_[child];
    place_[heap_[at]] = at;
    at = child;
  }
  heap_[at] = last;
  place_[last] = at;
  return top;
}

template <class Space>
auto PathFinder<Space>::shortest(const Graph<Space>& graph, int from, int to,
                                 std::span<int> nodes) noexcept -> Path {
  std::fill(length_.begin(), length_.end(), std::numeric_limits<double>::infinity());
  std::fill(before_.begin(), before_.end(), kNone);
  std::fill(place_.begin(), place_.end(), kNone);
  heap_count_ = 0;
  length_[from] = 0.0;
  push(from);
  while (heap_count_ > 0) {
    const int node = pop();
    if (node == to) break;
    const auto here = measure::position(graph.node(node).pose);
    graph.for_each_incident(node, [&](int index, int other) {
      const Factor<Space>& f = graph.factor(index);
      if (other == kNone || !f.state.active || f.weight < 0.5 || f.kind != FactorKind::kBetween)
        return;
      const double there =
          length_[node] + (measure::position(graph.node(other).pose) - here).norm();
      if (!(there < length_[other])) return;
      length_[other] = there;
      before_[other] = node;
      push(other);
    });
  }
  Path path;
  if (from != to && before_[to] == kNone) return path;
  int count = 0;
  for (int n = to; n != kNone; n = before_[n]) ++count;
  if (count > static_cast<int>(nodes.size())) return path;
  path.count = count;
  path.length_m = length_[to];
  for (int n = to; n != kNone; n = before_[n]) nodes[--count] = n;
  return path;
}

template class PathFinder<PlanarSpace>;
template class PathFinder<SpatialSpace>;

}  // namespace maplet
