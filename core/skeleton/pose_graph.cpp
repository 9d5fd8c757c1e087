// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/pose_graph.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/skeleton/linearise.hpp"

namespace maplet {

namespace {
// A gauge is held this many times stiffer than its first measurement: stiff enough to stay, soft
// enough that releasing it later (two groups join) cancels without loss.
constexpr double kAnchorStiffness = 1e3;
}  // namespace

template <class Space>
PoseGraph<Space>::PoseGraph(const PoseGraphLimits& limits, Arena& arena, const SolvePolicy& policy)
    : graph_{limits.max_nodes, limits.max_factors, arena},
      elimination_{graph_, limits.max_blocks, arena},
      stepper_{graph_, elimination_, arena},
      dirty_{arena.make_array<int>(limits.max_factors, "skeleton/queues")},
      job_{arena.make_array<int>(limits.max_factors, "skeleton/queues")},
      fresh_{arena.make_array<int>(limits.max_nodes, "skeleton/queues")},
      retired_factors_{arena.make_array<int>(limits.max_factors, "skeleton/queues")},
      retired_nodes_{arena.make_array<int>(limits.max_nodes, "skeleton/queues")},
      stack_{arena.make_array<int>(limits.max_nodes, "skeleton/queues")},
      reached_{arena.make_array<std::int64_t>(limits.max_nodes, "skeleton/queues")},
      freed_{arena.make_array<int>(limits.max_factors, "skeleton/queues")},
      policy_{policy} {
  if (policy_.work_per_update == 0) policy_.work_per_update = Space::kDim == 6 ? 160'000 : 100'000;
}

template <class Space>
int PoseGraph<Space>::add_node(const Pose& pose, Seniority seniority) noexcept {
  const int node = graph_.add_node(pose);
  graph_.node(node).seniority = seniority;
  graph_.node(node).arrival = arrivals_++;
  fresh_[fresh_count_++] = node;
  return node;
}

template <class Space>
int PoseGraph<Space>::add_point() noexcept {
  constexpr auto kNever = std::numeric_limits<std::uint64_t>::max();  // it is no pose's gauge
  const int node = add_node({}, {kNever, static_cast<std::uint64_t>(arrivals_)});
  graph_.node(node).point = true;
  return node;
}

template <class Space>
int PoseGraph<Space>::add_point(int a, const Pose& at) noexcept {
  const int node = add_point();
  graph_.node(node).pose = Space::compose(graph_.node(a).pose, at);
  graph_.node(node).group = graph_.node(a).group;
  return node;
}

template <class Space>
int PoseGraph<Space>::add_factor(FactorKind kind, int a, int b, const Pose& z,
                                 const Block& information, double weight) noexcept {
  Factor<Space> f;
  f.kind = kind;
  f.a = a;
  f.b = b;
  f.z = z;
  int k = 0;
  for (int r = 0; r < Space::kDim; ++r)
    for (int c = 0; c <= r; ++c) f.information[k++] = 0.5 * (information(r, c) + information(c, r));
  f.stiffness = information.diagonal().maxCoeff();
  f.weight = weight;
  const int index = graph_.add_factor(f);
  graph_.factor(index).state.active = false;
  for (const int n : {a, b})
    if (n != kNone && !graph_.node(n).point && graph_.node(n).arrival >= newest_arrival())
      newest_ = n;
  new_input_ = true;
  if (weight > 0.0) link_in(index);
  return index;
}

template <class Space>
int PoseGraph<Space>::add_between(int a, int b, const Pose& z, const Block& information,
                                  double weight) noexcept {
  return add_factor(FactorKind::kBetween, a, b, z, information, weight);
}

template <class Space>
int PoseGraph<Space>::add_sight(FactorKind kind, int a, int b, const Pose& z,
                                const Block& information, double weight) noexcept {
  return add_factor(kind, a, b, z, information, weight);
}

template <class Space>
int PoseGraph<Space>::add_prior(int a, const Pose& z, const Block& information,
                                double weight) noexcept {
  return add_factor(FactorKind::kPrior, a, kNone, z, information, weight);
}

// A factor begins to count: its nodes are of one group from now on.
template <class Space>
void PoseGraph<Space>::link_in(int factor) noexcept {
  Factor<Space>& f = graph_.factor(factor);
  if (f.kind == FactorKind::kPrior) {
    hold_by_prior(factor);
  } else {
    const bool apart = graph_.node(f.a).group != graph_.node(f.b).group;
    if (apart && measure::is_sight(f.kind)) return;  // it cannot say where: set_weight tries again
    for (const int n : {f.a, f.b}) {
      Node<Space>& gauge = graph_.node(graph_.node(n).group);
      if (gauge.anchor == 0.0 && gauge.priors == 0) gauge.anchor = kAnchorStiffness * f.stiffness;
    }
    if (apart) join_groups(f.a, f.b, f.z);
    appoint_gauge(f.a);
    appoint_gauge(f.b);
    hang(f.a, f.b, factor);
    hang(f.b, f.a, factor);
  }
  f.state.active = true;
  f.state.evaluated = f.state.aside = false;
  mark_dirty(factor);
  const typename Space::Tangent e = measure::error(f, relative_pose(graph_, f));
  pending_ += f.weight * e.dot(weigh(f, e));
  objective_changed_ = new_input_ = true;
}

// The factor that brought a new node here says where it is until it is eliminated.
template <class Space>
void PoseGraph<Space>::hang(int node, int from, int factor) noexcept {
  Node<Space>& n = graph_.node(node);
  if (n.hung_from != kNone || elimination_.contains(node) ||
      !(n.seniority > graph_.node(from).seniority))
    return;
  n.hung_from = factor;
  n.backup = Space::between(graph_.node(from).pose, n.pose);
}

// The first prior of a group moves it to where it says, and takes the gauge's place.
template <class Space>
void PoseGraph<Space>::hold_by_prior(int factor) noexcept {
  const Factor<Space>& f = graph_.factor(factor);
  const int gauge = graph_.node(f.a).group;
  if (++graph_.node(gauge).priors > 1) return;
  move_group(gauge, gauge, Space::compose(f.z, Space::between(graph_.node(f.a).pose, Pose{})));
}

template <class Space>
void PoseGraph<Space>::release_prior(int factor) noexcept {
  const Factor<Space>& f = graph_.factor(factor);
  const int gauge = graph_.node(f.a).group;
  if (--graph_.node(gauge).priors > 0) return;
  graph_.node(gauge).anchor = kAnchorStiffness * f.stiffness;
  graph_.for_each_incident(gauge, [&](int at, int) { mark_dirty(at); });
}

template <class Space>
void PoseGraph<Space>::connect(int a, int b, const Pose& T_a_b) noexcept {
  if (graph_.node(a).group != graph_.node(b).group) join_groups(a, b, T_a_b);
}

// The junior group moves rigidly so that z holds, and gives up its gauge; but one that priors hold
// stays.
template <class Space>
void PoseGraph<Space>::join_groups(int a, int b, const Pose& z) noexcept {
  const int group_a = graph_.node(a).group;
  const int group_b = graph_.node(b).group;
  const bool a_senior = graph_.node(group_a).seniority < graph_.node(group_b).seniority;
  const bool a_held = graph_.node(group_a).priors > 0;
  const bool b_held = graph_.node(group_b).priors > 0;
  const bool move_b = a_held != b_held ? a_held : a_senior;
  const Pose should = move_b ? Space::compose(graph_.node(a).pose, z)
                             : Space::compose(graph_.node(b).pose, Space::between(z, Pose{}));
  const int moved = move_b ? b : a;
  const Pose by = Space::compose(should, Space::between(graph_.node(moved).pose, Pose{}));
  const int from = move_b ? group_b : group_a;
  const int to = move_b ? group_a : group_b;
  graph_.node(to).priors += std::exchange(graph_.node(from).priors, 0);
  move_group(from, to, by);
  appoint_gauge(from);
}

template <class Space>
void PoseGraph<Space>::move_group(int gauge, int new_gauge, const Pose& by) noexcept {
  graph_.node(gauge).anchor = 0.0;
  const auto move = [&](Node<Space>& n) {
    n.pose = Space::compose(by, n.pose);
    n.group = new_gauge;
  };
  bool alone = true;
  graph_.for_each_incident(gauge, [&](int f, int) { alone &= !graph_.factor(f).state.active; });
  if (alone) {  // a node on its own: the usual case
    move(graph_.node(gauge));
    return;
  }
  for (int i = 0; i < graph_.node_end(); ++i)
    if (graph_.node(i).used && graph_.node(i).group == gauge) move(graph_.node(i));
  stepper_.forget_step();
  // The columns hold the anchor: factors there, eliminated anew, take it out or in.
  graph_.for_each_incident(gauge, [&](int f, int) { mark_dirty(f); });
}

template <class Space>
void PoseGraph<Space>::appoint_gauge(int node) noexcept {
  const int old = graph_.node(node).group;
  if (!(graph_.node(node).seniority < graph_.node(old).seniority)) return;
  graph_.node(node).anchor = graph_.node(old).anchor;
  graph_.node(node).priors = std::exchange(graph_.node(old).priors, 0);
  const bool held = graph_.node(node).priors > 0;
  move_group(old, node, held ? Pose{} : Space::between(graph_.node(node).pose, Pose{}));
}

// How many nodes hang together with one; reached_ marks them.
template <class Space>
int PoseGraph<Space>::reach(int from) noexcept {
  ++searches_;
  int count = 0;
  int total = 0;
  const auto push = [&](int node) {
    if (node == kNone || reached_[node] == searches_) return;
    reached_[node] = searches_;
    stack_[count++] = node;
    ++total;
  };
  push(from);
  while (count > 0) {
    graph_.for_each_incident(stack_[--count], [&](int index, int other) {
      if (graph_.factor(index).state.active) push(other);
    });
  }
  return total;
}

// A factor between a and b counts no more. Where nothing else holds them together, the part without
// the gauge becomes a group of its own.
template <class Space>
void PoseGraph<Space>::split_if_apart(int a, int b) noexcept {
  const int old = graph_.node(a).group;
  if (old != graph_.node(b).group) return;
  for (const auto& [from, other] : {std::pair{a, b}, std::pair{b, a}}) {
    (void)reach(from);
    if (reached_[other] == searches_) return;  // another way round
    if (reached_[old] == searches_) continue;
    int head = from;
    int priors = 0;
    for (int i = 0; i < graph_.node_end(); ++i) {
      const Node<Space>& n = graph_.node(i);
      if (!n.used || reached_[i] != searches_) continue;
      if (n.seniority < graph_.node(head).seniority) head = i;
      graph_.for_each_incident(i, [&](int f, int) {
        priors += graph_.factor(f).kind == FactorKind::kPrior && graph_.factor(f).state.active;
      });
    }
    double stiffness = 0.0;
    graph_.for_each_incident(head, [&](int f, int) {
      if (graph_.factor(f).state.active) stiffness = graph_.factor(f).stiffness;
    });
    graph_.node(old).priors -= priors;
    graph_.node(head).priors = priors;
    graph_.node(head).anchor = priors > 0 ? 0.0 : kAnchorStiffness * stiffness;
    const Pose by = priors > 0 ? Pose{} : Space::between(graph_.node(head).pose, Pose{});
    for (int i = 0; i < graph_.node_end(); ++i) {
      Node<Space>& n = graph_.node(i);
      if (!n.used || reached_[i] != searches_) continue;
      n.pose = Space::compose(by, n.pose);
      n.group = head;
    }
    stepper_.forget_step();
    graph_.for_each_incident(head, [&](int f, int) { mark_dirty(f); });
    return;
  }
}

template <class Space>
void PoseGraph<Space>::mark_dirty(int factor) noexcept {
  FactorState& s = graph_.factor(factor).state;
  if (s.dirty) return;
  s.dirty = true;
  dirty_[dirty_count_++] = factor;
}

template <class Space>
void PoseGraph<Space>::set_weight(int factor, double weight) noexcept {
  Factor<Space>& f = graph_.factor(factor);
  if (weight == f.weight && f.state.active == (weight > 0.0)) return;
  const double before = f.weight;
  f.weight = weight;
  f.state.evaluated = false;
  if (weight > 0.0 && !f.state.active) return link_in(factor);
  pending_ += std::abs(weight - before) * f.chi2;
  if (weight == 0.0) {
    if (f.kind == FactorKind::kPrior && f.state.active) release_prior(factor);
    stepper_.withdraw(factor);
    f.state.aside = false;
    const bool counted = std::exchange(f.state.active, false);
    if (counted && !f.state.retired && f.b != kNone && f.kind == FactorKind::kBetween)
      split_if_apart(f.a, f.b);
  }
  mark_dirty(factor);
  objective_changed_ = new_input_ = true;
  settled_ = false;
}

template class PoseGraph<PlanarSpace>;
template class PoseGraph<SpatialSpace>;

}  // namespace maplet
