// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The job's course: which nodes, their order, the commit. elimination_numeric.cpp does the numbers.
#include "core/skeleton/elimination.hpp"

#include <algorithm>

namespace maplet {

template <class Space>
Elimination<Space>::Elimination(Graph<Space>& graph, int max_blocks, Arena& arena)
    : graph_{graph},
      pool_{graph.max_nodes(), max_blocks, arena},
      ordering_{graph.max_nodes(), graph.max_factors(), pool_.slots(), arena},
      tree_{arena.make_array<Link>(graph.max_nodes(), "skeleton/tree")},
      work_{arena.make_array<Work>(graph.max_nodes(), "skeleton/elimination")},
      anchored_{arena.make_array<double>(graph.max_nodes(), "skeleton/elimination")},
      nodes_{arena.make_array<int>(graph.max_nodes(), "skeleton/elimination")},
      last_{arena.make_array<int>(graph.max_nodes(), "skeleton/elimination")},
      names_{arena.make_array<int>(graph.max_nodes(), "skeleton/elimination")},
      orphans_{arena.make_array<int>(graph.max_nodes(), "skeleton/elimination")} {}

template <class Space>
void Elimination<Space>::clear_job() noexcept {
  ++job_;
  count_ = last_count_ = orphan_count_ = ordered_ = eliminated_ = 0;
  everything_ = false;
  damping_ = 0.0;
  model_ = Model::kExact;
}

template <class Space>
void Elimination<Space>::touch(int node) noexcept {
  while (node != kNone && !in_job(node)) {
    work_[node] = {};
    work_[node].job = job_;
    nodes_[count_++] = node;
    node = tree_[node].parent;
  }
}

template <class Space>
void Elimination<Space>::keep_last(int node) noexcept {
  if (work_[node].last) return;
  work_[node].last = true;
  last_[last_count_++] = node;
}

template <class Space>
void Elimination<Space>::touch_all(double damping, Model model) noexcept {
  everything_ = true;
  damping_ = damping;
  model_ = model;
  for (int i = 0; i < graph_.node_end(); ++i)
    if (graph_.node(i).used) touch(i);
}

template <class Space>
void Elimination<Space>::order_by_seniority(bool on) noexcept {
  by_seniority_ = on;
  ordering_.break_ties_by({});
  if (!on) return;
  int count = 0;
  for (int i = 0; i < graph_.node_end(); ++i)
    if (graph_.node(i).used) last_[count++] = i;
  std::sort(last_.begin(), last_.begin() + count,
            [&](int x, int y) { return graph_.node(x).seniority < graph_.node(y).seniority; });
  for (int k = 0; k < count; ++k) names_[last_[k]] = k;
  ordering_.break_ties_by(names_);
}

template <class Space>
void Elimination<Space>::begin() noexcept {
  // Room for twice what the affected columns held, or once for all of them, which an order from
  // nothing does not make longer; else first throw the garbage out.
  int held = 0;
  for (int k = 0; k < count_; ++k) held += std::max(pool_.length(nodes_[k]), 4);
  if (!everything_) pool_.compact_some(8 * held);
  const int wanted = everything_ ? held : 2 * held;
  if (pool_.free_slots() < wanted && pool_.live() < pool_.end()) pool_.compact();
  effort_ += 4 * held;
  prepare_ordering();
  pool_mark_ = pool_.end();
  phase_ = Phase::kOrder;
}

template <class Space>
void Elimination<Space>::prepare_ordering() noexcept {
  ordering_.clear();
  if (by_seniority_) {
    std::sort(nodes_.begin(), nodes_.begin() + count_,
              [&](int x, int y) { return names_[x] < names_[y]; });
  }
  for (int k = 0; k < count_; ++k)
    if (!work_[nodes_[k]].last) ordering_.add_variable(nodes_[k], false);
  for (int k = 0; k < last_count_; ++k) ordering_.add_variable(last_[k], true);
  for (int k = 0; k < count_; ++k) {
    const int node = nodes_[k];
    ordering_.begin_edges(node);
    graph_.for_each_incident(node, [&](int factor, int other) {
      const FactorState& s = graph_.factor(factor).state;
      if (other != kNone && s.active && (s.integrated || s.in_job) && in_job(other))
        ordering_.add_edge(node, other);
    });
  }
  for (int k = 0; k < count_; ++k) {
    for (int c = tree_[nodes_[k]].first_child; c != kNone; c = tree_[c].next) {
      if (in_job(c)) continue;
      orphans_[orphan_count_++] = c;
      const int start = pool_.start(c);
      ordering_.add_element(c, start + 1, start + pool_.length(c));
    }
  }
  ordering_.ready({nodes_.data(), static_cast<std::size_t>(count_)});
}

template <class Space>
auto Elimination<Space>::run(Allowance& allowance) noexcept -> Result {
  const auto late = [&] {
    const int effort = effort_;
    effort_ = 0;
    return allowance.spend(effort);
  };
  if (phase_ == Phase::kOrder) {
    while (ordering_.remaining() > 0) {
      if (late()) return Result::kDeadline;
      const int pivot = ordering_.pick();
      const int length = ordering_.eliminate(pivot, pool_.end(), pool_.free_slots());
      if (length == kNone) {
        abandon();
        return Result::kFull;
      }
      Work& w = work_[pivot];
      w.start = pool_.end();
      w.length = length;
      w.rank = next_rank_++;
      pool_.append(length);
      last_[ordered_++] = pivot;  // taken over: those kept last are all variables by now
      effort_ += 4 * length;
    }
    std::copy_n(last_.begin(), count_, nodes_.begin());
    sort_by_new_rank();
    phase_ = Phase::kNumeric;
  }
  while (eliminated_ < count_) {
    if (late()) return Result::kDeadline;
    eliminate(nodes_[eliminated_++]);
  }
  commit();
  return Result::kCommitted;
}

template <class Space>
void Elimination<Space>::abandon() noexcept {
  pool_.rewind(pool_mark_);
  phase_ = Phase::kIdle;
}

template <class Space>
void Elimination<Space>::sort_by_new_rank() noexcept {
  const auto earlier = [&](const ColumnSlot& x, const ColumnSlot& y) {
    return work_[x.row].rank < work_[y.row].rank;
  };
  for (int k = 0; k < count_; ++k) {
    const int node = nodes_[k];
    const auto first = pool_.slots().begin() + work_[node].start;
    std::sort(first + 1, first + work_[node].length, earlier);
    if (everything_ || !pool_.has(node)) continue;
    // The old column, diagonal included, by the new order: a permutation kept in the links.
    const int start = pool_.start(node);
    const int length = pool_.length(node);
    for (int i = 0; i < length; ++i) pool_.slot(start + i).link = start + i;
    for (int i = 1; i < length; ++i) {  // insertion: mostly sorted already
      const int moving = pool_.slot(start + i).link;
      const std::int64_t rank = work_[pool_.slot(moving).row].rank;
      int to = i;
      while (to > 0 && work_[pool_.slot(pool_.slot(start + to - 1).link).row].rank > rank) {
        pool_.slot(start + to).link = pool_.slot(start + to - 1).link;
        --to;
      }
      pool_.slot(start + to).link = moving;
    }
    Work& first_row = work_[pool_.slot(pool_.slot(start).link).row];
    work_[node].old_cursor = start;
    work_[node].old_next = first_row.old_head;
    first_row.old_head = node;
  }
}

template <class Space>
void Elimination<Space>::commit() noexcept {
  for (int k = 0; k < count_; ++k) unlink(nodes_[k]);
  for (int k = 0; k < count_; ++k) tree_[nodes_[k]].first_child = kNone;
  for (int k = 0; k < count_; ++k) {
    const int node = nodes_[k];
    pool_.adopt(node, work_[node].start, work_[node].length);
    tree_[node].rank = work_[node].rank;
  }
  for (int k = count_ - 1; k >= 0; --k) {
    const int node = nodes_[k];
    link(node, pool_.length(node) > 1 ? pool_.slot(pool_.start(node) + 1).row : kNone);
  }
  for (int k = 0; k < orphan_count_; ++k) {  // their first row may be another by the new order
    const int child = orphans_[k];
    int parent = kNone;
    for (int s = pool_.start(child) + 1; s < pool_.start(child) + pool_.length(child); ++s) {
      const int row = pool_.slot(s).row;
      if (parent == kNone || tree_[row].rank < tree_[parent].rank) parent = row;
    }
    link(child, parent);
  }
  effort_ += 4 * count_;
  phase_ = Phase::kIdle;
}

template <class Space>
void Elimination<Space>::unlink(int node) noexcept {
  Link& l = tree_[node];
  if (!pool_.has(node)) return;  // never linked
  if (l.prev != kNone) {
    tree_[l.prev].next = l.next;
  } else if (l.parent != kNone) {
    tree_[l.parent].first_child = l.next;
  } else {
    first_root_ = l.next;
  }
  if (l.next != kNone) tree_[l.next].prev = l.prev;
  l.next = l.prev = kNone;
}

template <class Space>
void Elimination<Space>::link(int node, int parent) noexcept {
  Link& l = tree_[node];
  int& head = parent != kNone ? tree_[parent].first_child : first_root_;
  l.parent = parent;
  l.prev = kNone;
  l.next = head;
  if (head != kNone) tree_[head].prev = node;
  head = node;
}

template <class Space>
void Elimination<Space>::forget(int node) noexcept {
  if (!pool_.has(node)) return;
  unlink(node);
  pool_.drop(node);
  anchored_[node] = 0.0;
  tree_[node] = {};
}

template <class Space>
void Elimination<Space>::clear() noexcept {
  pool_.clear();
  for (Link& l : tree_) l = {};
  for (double& a : anchored_) a = 0.0;
  first_root_ = kNone;
}

template class Elimination<PlanarSpace>;
template class Elimination<SpatialSpace>;

}  // namespace maplet
