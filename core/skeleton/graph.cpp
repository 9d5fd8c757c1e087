// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/graph.hpp"

namespace maplet {

template <class Space>
int Graph<Space>::add_node(const typename Space::Pose& pose) noexcept {
  int i = free_node_;
  if (i != kNone) {
    free_node_ = nodes_[i].first_incidence;
  } else {
    i = node_end_++;
  }
  nodes_[i] = {};
  nodes_[i].pose = pose;
  nodes_[i].used = true;
  nodes_[i].group = i;
  ++node_count_;
  return i;
}

template <class Space>
void Graph<Space>::remove_node(int node) noexcept {
  nodes_[node].used = false;
  nodes_[node].first_incidence = free_node_;
  free_node_ = node;
  --node_count_;
}

template <class Space>
int Graph<Space>::add_factor(const Factor<Space>& factor) noexcept {
  int i = free_factor_;
  if (i != kNone) {
    free_factor_ = factors_[i].next[0];
  } else {
    i = factor_end_++;
  }
  Factor<Space>& f = factors_[i];
  f = factor;
  f.state.active = true;
  f.next[0] = nodes_[f.a].first_incidence;
  nodes_[f.a].first_incidence = 2 * i;
  if (f.b != kNone) {
    f.next[1] = nodes_[f.b].first_incidence;
    nodes_[f.b].first_incidence = 2 * i + 1;
  }
  ++factor_count_;
  return i;
}

template <class Space>
void Graph<Space>::unlink(int node, int incidence) noexcept {
  int* link = &nodes_[node].first_incidence;
  while (*link != incidence) link = &factors_[*link >> 1].next[*link & 1];
  *link = factors_[incidence >> 1].next[incidence & 1];
}

template <class Space>
void Graph<Space>::remove_factor(int factor) noexcept {
  Factor<Space>& f = factors_[factor];
  unlink(f.a, 2 * factor);
  if (f.b != kNone) unlink(f.b, 2 * factor + 1);
  f.state = {};
  f.a = f.b = kNone;
  f.next = {free_factor_, kNone};
  free_factor_ = factor;
  --factor_count_;
}

template class Graph<PlanarSpace>;
template class Graph<SpatialSpace>;

}  // namespace maplet
