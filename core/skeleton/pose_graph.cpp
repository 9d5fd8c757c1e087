// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/pose_graph.hpp"

#include <algorithm>

#include "core/skeleton/linearise.hpp"

namespace maplet {

namespace {
// A gauge is held this many times stiffer than its first measurement: stiff enough to stay, soft
// enough that releasing it later (two groups join) cancels without loss.
constexpr double kAnchorStiffness = 1e3;
}  // namespace

template <class Space>
PoseGraph<Space>::PoseGraph(const PoseGraphLimits& limits, Arena& arena)
    : graph_{limits.max_nodes, limits.max_factors, arena},
      elimination_{graph_, limits.max_blocks, arena},
      gradient_{arena.make_array<Tangent>(limits.max_nodes, "skeleton/vectors")},
      delta_{arena.make_array<Tangent>(limits.max_nodes, "skeleton/vectors")},
      sequence_{arena.make_array<int>(limits.max_nodes, "skeleton/vectors")},
      dirty_{arena.make_array<int>(limits.max_factors, "skeleton/queues")},
      job_{arena.make_array<int>(limits.max_factors, "skeleton/queues")} {}

template <class Space>
int PoseGraph<Space>::add_node(const Pose& pose, Seniority seniority) noexcept {
  const int node = graph_.add_node(pose);
  graph_.node(node).seniority = seniority;
  return node;
}

template <class Space>
int PoseGraph<Space>::add_between(int a, int b, const Pose& z, const Block& information) noexcept {
  const double stiffness = kAnchorStiffness * information.diagonal().maxCoeff();
  for (const int n : {a, b}) {
    Node<Space>& gauge = graph_.node(graph_.node(n).group);
    if (gauge.anchor == 0.0) gauge.anchor = stiffness;
  }
  if (graph_.node(a).group != graph_.node(b).group) join_groups(a, b, z);
  appoint_gauge(a);
  appoint_gauge(b);
  Factor<Space> f;
  f.a = a;
  f.b = b;
  f.z = z;
  int k = 0;
  for (int r = 0; r < Space::kDim; ++r)
    for (int c = 0; c <= r; ++c) f.information[k++] = 0.5 * (information(r, c) + information(c, r));
  const int index = graph_.add_factor(f);
  mark_dirty(index);
  newest_ = std::max(a, b);
  return index;
}

// The junior group moves rigidly so that z holds, and gives up its gauge.
template <class Space>
void PoseGraph<Space>::join_groups(int a, int b, const Pose& z) noexcept {
  const int group_a = graph_.node(a).group;
  const int group_b = graph_.node(b).group;
  const bool move_b = graph_.node(group_a).seniority < graph_.node(group_b).seniority;
  const Pose should = move_b ? Space::compose(graph_.node(a).pose, z)
                             : Space::compose(graph_.node(b).pose, Space::between(z, Pose{}));
  const int moved = move_b ? b : a;
  const Pose by = Space::compose(should, Space::between(graph_.node(moved).pose, Pose{}));
  move_group(move_b ? group_b : group_a, move_b ? group_a : group_b, by);
}

template <class Space>
void PoseGraph<Space>::move_group(int gauge, int new_gauge, const Pose& by) noexcept {
  graph_.node(gauge).anchor = 0.0;
  const auto move = [&](Node<Space>& n) {
    n.pose = Space::compose(by, n.pose);
    n.group = new_gauge;
  };
  if (graph_.node(gauge).first_incidence == kNone) {  // a node on its own: the usual case
    move(graph_.node(gauge));
    return;
  }
  for (int i = 0; i < graph_.node_end(); ++i)
    if (graph_.node(i).used && graph_.node(i).group == gauge) move(graph_.node(i));
  best_chi2_ = -1.0;
  // The columns hold the anchor: factors there, eliminated anew, take it out or in.
  graph_.for_each_incident(gauge, [&](int f, int) { mark_dirty(f); });
}

template <class Space>
void PoseGraph<Space>::appoint_gauge(int node) noexcept {
  const int old = graph_.node(node).group;
  if (!(graph_.node(node).seniority < graph_.node(old).seniority)) return;
  graph_.node(node).anchor = graph_.node(old).anchor;
  move_group(old, node, Space::between(graph_.node(node).pose, Pose{}));
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
  graph_.factor(factor).weight = weight;
  mark_dirty(factor);
  best_chi2_ = -1.0;
}

template <class Space>
void PoseGraph<Space>::start_job() noexcept {
  elimination_.clear_job();
  std::swap(dirty_, job_);
  job_count_ = dirty_count_;
  dirty_count_ = 0;
  for (int k = 0; k < job_count_; ++k) {
    Factor<Space>& f = graph_.factor(job_[k]);
    f.state.dirty = false;
    f.state.in_job = true;
    elimination_.touch(f.a);
    if (f.b != kNone) elimination_.touch(f.b);
  }
  if (newest_ != kNone && graph_.node(newest_).used) {
    elimination_.touch(newest_);
    elimination_.keep_last(newest_);
  }
  elimination_.begin();
}

template <class Space>
void PoseGraph<Space>::finish_job() noexcept {
  for (int k = 0; k < job_count_; ++k) graph_.factor(job_[k]).state.in_job = false;
  job_count_ = 0;
  sequence_stale_ = true;
  unsettled_ = true;
  best_chi2_ = -1.0;
}

template <class Space>
SolveReport PoseGraph<Space>::update(Deadline deadline, int max_iterations) noexcept {
  SolveReport report;
  for (;;) {
    if (!elimination_.busy() && dirty_count_ > 0) start_job();
    if (elimination_.busy()) {
      const auto result = elimination_.run(deadline);
      if (result == Elimination<Space>::Result::kDeadline) {
        report.stop = Stop::kDeadline;
        break;
      }
      if (result == Elimination<Space>::Result::kFull) ++overflows_;  // kept waiting
      finish_job();
      continue;
    }
    if (!unsettled_) break;
    if (report.iterations == max_iterations) {
      report.stop = Stop::kIterationLimit;
      break;
    }
    if (deadline.expired()) {
      report.stop = Stop::kDeadline;
      break;
    }
    if (step() != StepResult::kMoved) unsettled_ = false;
    ++report.iterations;
  }
  report.chi2 = chi2_;
  return report;
}

template class PoseGraph<PlanarSpace>;
template class PoseGraph<SpatialSpace>;

}  // namespace maplet
