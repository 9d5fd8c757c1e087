// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Nodes at the ends of their life: those that wait for their elimination, those that are taken out.
#include <Eigen/Cholesky>
#include <algorithm>

#include "core/skeleton/linearise.hpp"
#include "core/skeleton/pose_graph.hpp"

namespace maplet {

// Nodes that no elimination holds yet do not move with a step: they follow what they hang from.
template <class Space>
void PoseGraph<Space>::place_fresh_nodes() noexcept {
  for (int k = 0; k < fresh_count_; ++k) {
    Node<Space>& n = graph_.node(fresh_[k]);
    if (n.hung_from == kNone) continue;
    n.pose = Space::compose(graph_.node(support(fresh_[k])).pose, n.backup);
  }
}

// Waiting nodes once more from their odometry on, each where its measurements want it: what they
// were fitted to may have moved or been taken back.
template <class Space>
void PoseGraph<Space>::hang_anew() noexcept {
  for (int k = 0; k < fresh_count_; ++k) {
    Node<Space>& n = graph_.node(fresh_[k]);
    if (n.hung_from == kNone) continue;
    const Factor<Space>& f = graph_.factor(n.hung_from);
    if (f.kind == FactorKind::kBetween)
      n.backup = f.b == fresh_[k] ? f.z : Space::between(f.z, Pose{});
    n.pose = Space::compose(graph_.node(support(fresh_[k])).pose, n.backup);
    relax(fresh_[k]);
  }
}

// The node that a waiting one hangs from.
template <class Space>
int PoseGraph<Space>::support(int node) const noexcept {
  const Factor<Space>& f = graph_.factor(graph_.node(node).hung_from);
  return f.a == node ? f.b : f.a;
}

// One Gauss-Newton step of a waiting node alone, its neighbours held: it stays where all of its
// measurements want it, however long they wait (eq. 14).
template <class Space>
void PoseGraph<Space>::relax(int node) noexcept {
  Node<Space>& n = graph_.node(node);
  if (n.hung_from == kNone || n.point) return;
  Block h = Block::Zero();
  Tangent g = Tangent::Zero();
  int factors = 0;
  const auto cost = [&](auto&& each) {
    double sum = 0.0;
    graph_.for_each_incident(node, [&](int index, int other) {
      const Factor<Space>& f = graph_.factor(index);
      if (other == kNone || !f.state.active || f.weight == 0.0) return;
      const Pose rel = relative_pose(graph_, f);
      const Tangent e = measure::error(f, rel);
      const Tangent v = weigh(f, e);
      sum += f.weight * e.dot(v);
      each(f, rel, e, v);
    });
    return sum;
  };
  const double before =
      cost([&](const Factor<Space>& f, const Pose& rel, const Tangent& e, const Tangent& v) {
        Tangent by_a, by_b;
        measure::pull_back(f, rel, e, (-f.weight * v).eval(), by_a, by_b);
        const HessianBlocks<Space> blocks = hessian(f, rel, f.weight);
        g += f.a == node ? by_a : by_b;
        h += f.a == node ? blocks.aa : blocks.bb;
        ++factors;
      });
  if (factors < 2 || !(before > 0.0)) return;
  const Pose old = n.pose;
  n.pose = Space::retract(old, h.llt().solve(g));
  const double after = cost([](const auto&...) {});
  if (!(after < before)) {
    n.pose = old;
    return;
  }
  n.backup = Space::between(graph_.node(support(node)).pose, n.pose);
  pending_ = std::max(0.0, pending_ + after - before);
}

template <class Space>
void PoseGraph<Space>::retire_factor(int factor) noexcept {
  FactorState& s = graph_.factor(factor).state;
  if (s.retired) return;
  s.retired = true;  // before: what it held together, others do now
  set_weight(factor, 0.0);
  retired_factors_[retired_factor_count_++] = factor;
}

template <class Space>
void PoseGraph<Space>::retire_node(int node) noexcept {
  graph_.node(node).retired = true;
  retired_nodes_[retired_node_count_++] = node;
}

template <class Space>
void PoseGraph<Space>::free_retired_factors() noexcept {
  if (retired_factor_count_ == 0) return;
  flush();
  Allowance unlimited = Allowance::unlimited();
  (void)stepper_.catch_up(unlimited);
  stepper_.take_stale([](int) {});
  stepper_.forget_step();
  for (int k = 0; k < retired_factor_count_; ++k) {
    const int factor = retired_factors_[k];
    const Factor<Space>& f = graph_.factor(factor);
    for (const int n : {f.a, f.b})
      if (n != kNone && graph_.node(n).hung_from == factor) graph_.node(n).hung_from = kNone;
    graph_.remove_factor(factor);
    if (freed_count_ < static_cast<int>(freed_.size())) freed_[freed_count_++] = factor;
  }
  retired_factor_count_ = 0;
}

template <class Space>
void PoseGraph<Space>::free_retired_nodes() noexcept {
  for (int k = 0; k < retired_node_count_; ++k) {
    const int node = retired_nodes_[k];
    elimination_.forget(node);
    stepper_.forget_node(node);
    fresh_count_ = static_cast<int>(
        std::remove(fresh_.begin(), fresh_.begin() + fresh_count_, node) - fresh_.begin());
    if (newest_ == node) newest_ = kNone;
    graph_.remove_node(node);
  }
  retired_node_count_ = 0;
}

#define MAPLET_INSTANTIATE(Space)                                  \
  template void PoseGraph<Space>::place_fresh_nodes() noexcept;    \
  template void PoseGraph<Space>::hang_anew() noexcept;            \
  template int PoseGraph<Space>::support(int) const noexcept;      \
  template void PoseGraph<Space>::relax(int) noexcept;             \
  template void PoseGraph<Space>::retire_factor(int) noexcept;     \
  template void PoseGraph<Space>::retire_node(int) noexcept;       \
  template void PoseGraph<Space>::free_retired_factors() noexcept; \
  template void PoseGraph<Space>::free_retired_nodes() noexcept;
MAPLET_INSTANTIATE(PlanarSpace)
MAPLET_INSTANTIATE(SpatialSpace)
#undef MAPLET_INSTANTIATE

}  // namespace maplet
