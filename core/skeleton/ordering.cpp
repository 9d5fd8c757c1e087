// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/ordering.hpp"

#include <algorithm>

namespace maplet {

Ordering::Ordering(int max_nodes, int max_factors, std::span<ColumnSlot> slots, Arena& arena)
    : slots_{slots},
      item_{arena.make_array<Item>(max_nodes, "skeleton/ordering")},
      bucket_{arena.make_array<int>(max_nodes + 1, "skeleton/ordering")},
      edges_{arena.make_array<int>(2 * static_cast<std::size_t>(max_factors), "skeleton/ordering")},
      last_{arena.make_array<int>(max_nodes, "skeleton/ordering")} {
  for (int& b : bucket_) b = kNone;
}

void Ordering::clear() noexcept {
  ++epoch_;
  for (int d = 0; d <= free_count_ && d < static_cast<int>(bucket_.size()); ++d) bucket_[d] = kNone;
  last_count_ = last_next_ = edge_end_ = remaining_ = free_count_ = lowest_ = 0;
}

void Ordering::add_variable(int node, bool last) noexcept {
  Item& item = item_[node];
  const std::int64_t mark = item.mark;  // marks only ever grow
  item = {};
  item.mark = mark;
  item.epoch = epoch_;
  item.last = last;
  ++remaining_;
  if (last) {
    last_[last_count_++] = node;
  } else {
    ++free_count_;
  }
}

void Ordering::begin_edges(int node) noexcept {
  item_[node].first_edge = edge_end_;
  item_[node].mark = ++mark_;  // an edge to itself is none
}

void Ordering::add_edge(int node, int other) noexcept {
  if (item_[other].mark == mark_) return;
  item_[other].mark = mark_;
  edges_[edge_end_++] = other;
  ++item_[node].edge_count;
}

void Ordering::add_element(int element, int begin, int end) noexcept {
  Item& e = item_[element];
  e.alive = true;
  e.size = end - begin;
  e.rows_begin = begin;
  e.rows_end = end;
  e.outside_mark = 0;
  for (int s = begin; s < end; ++s) {
    Item& v = item_[slots_[s].row];
    slots_[s].link = v.first_slot;
    v.first_slot = s;
    v.degree += e.size - 1;
  }
}

void Ordering::ready(std::span<const int> variables) noexcept {
  lowest_ = free_count_;
  for (const int i : variables) {
    item_[i].degree = std::min(item_[i].degree + item_[i].edge_count, remaining_ - 1);
    if (!item_[i].last) insert(i, item_[i].degree);
  }
}

void Ordering::insert(int node, int degree) noexcept {
  const int d = std::min(degree, free_count_);
  Item& item = item_[node];
  item.degree = d;
  item.bucket_prev = kNone;
  item.bucket_next = bucket_[d];
  if (bucket_[d] != kNone) item_[bucket_[d]].bucket_prev = node;
  bucket_[d] = node;
  lowest_ = std::min(lowest_, d);
}

void Ordering::take_out(int node) noexcept {
  const Item& item = item_[node];
  if (item.bucket_prev != kNone) {
    item_[item.bucket_prev].bucket_next = item.bucket_next;
  } else {
    bucket_[item.degree] = item.bucket_next;
  }
  if (item.bucket_next != kNone) item_[item.bucket_next].bucket_prev = item.bucket_prev;
}

int Ordering::pick() noexcept {
  while (lowest_ <= free_count_ && bucket_[lowest_] == kNone) ++lowest_;
  if (lowest_ > free_count_) return last_[last_next_++];
  const int node = bucket_[lowest_];
  take_out(node);
  return node;
}

// The pivot's column: its edges and the variables of its elements, which it absorbs.
int Ordering::write_column(int pivot, int at, int room) noexcept {
  if (room < 1) return kNone;
  Item& p = item_[pivot];
  const std::int64_t mark = ++mark_;
  p.mark = mark;
  int end = at;
  slots_[end++] = {pivot, pivot, kNone};
  const auto append = [&](int row) {
    Item& v = item_[row];
    if (v.eliminated || v.mark == mark) return true;
    if (end - at == room) return false;
    v.mark = mark;
    slots_[end++] = {row, pivot, kNone};
    return true;
  };
  for (int k = 0; k < p.edge_count; ++k)
    if (!append(edges_[p.first_edge + k])) return kNone;
  for (int s = p.first_slot; s != kNone; s = slots_[s].link) {
    Item& e = item_[slots_[s].owner];
    if (!e.alive) continue;
    for (int r = e.rows_begin; r < e.rows_end; ++r)
      if (!append(slots_[r].row)) return kNone;
    e.alive = false;
  }
  return end - at;
}

// For each element that meets the pivot's column: how many of its variables lie outside of it.
void Ordering::measure_outside(int pivot, int at, int end) noexcept {
  const std::int64_t stamp = item_[pivot].mark;
  for (int r = at + 1; r < end; ++r) {
    int* link = &item_[slots_[r].row].first_slot;
    while (*link != kNone) {
      ColumnSlot& slot = slots_[*link];
      Item& e = item_[slot.owner];
      if (!e.alive) {  // absorbed: forget it
        *link = slot.link;
        continue;
      }
      if (e.outside_mark != stamp) {
        e.outside_mark = stamp;
        e.outside = e.size;
      }
      --e.outside;
      link = &slot.link;
    }
  }
}

void Ordering::update_degree(int node, int pivot, int others) noexcept {
  Item& v = item_[node];
  int degree = others;
  int* link = &v.first_slot;
  while (*link != kNone) {
    ColumnSlot& slot = slots_[*link];
    Item& e = item_[slot.owner];
    if (e.alive && e.outside == 0) e.alive = false;  // inside the new element
    if (!e.alive) {
      *link = slot.link;
      continue;
    }
    degree += e.outside;
    link = &slot.link;
  }
  int kept = 0;
  for (int k = 0; k < v.edge_count; ++k) {
    const int other = edges_[v.first_edge + k];
    if (item_[other].eliminated || item_[other].mark == item_[pivot].mark) continue;
    edges_[v.first_edge + kept++] = other;
  }
  v.edge_count = kept;
  degree = std::min({degree + kept, v.degree + others, remaining_ - 1});
  if (v.last) {
    v.degree = degree;
  } else {
    insert(node, degree);
  }
}

int Ordering::eliminate(int pivot, int at, int room) noexcept {
  const int length = write_column(pivot, at, room);
  if (length == kNone) return kNone;
  Item& p = item_[pivot];
  p.eliminated = true;
  --remaining_;
  const int end = at + length;
  if (!names_.empty()) {
    std::sort(
        slots_.begin() + at + 1, slots_.begin() + end,
        [&](const ColumnSlot& x, const ColumnSlot& y) { return names_[x.row] < names_[y.row]; });
  }
  measure_outside(pivot, at, end);
  for (int r = at + 1; r < end; ++r) {
    const int node = slots_[r].row;
    if (!item_[node].last) take_out(node);
    update_degree(node, pivot, length - 2);
  }
  p.alive = true;
  p.size = length - 1;
  p.rows_begin = at + 1;
  p.rows_end = end;
  for (int r = at + 1; r < end; ++r) {
    Item& v = item_[slots_[r].row];
    slots_[r].link = v.first_slot;
    v.first_slot = r;
  }
  return length;
}

}  // namespace maplet
