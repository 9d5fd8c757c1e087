// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/pose_graph.hpp"

#include <algorithm>
#include <cmath>

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
      stepper_{graph_, elimination_, arena},
      dirty_{arena.make_array<int>(limits.max_factors, "skeleton/queues")},
      job_{arena.make_array<int>(limits.max_factors, "skeleton/queues")},
      fresh_{arena.make_array<int>(limits.max_nodes, "skeleton/queues")} {}

template <class Space>
int PoseGraph<Space>::add_node(const Pose& pose, Seniority seniority) noexcept {
  const int node = graph_.add_node(pose);
  graph_.node(node).seniority = seniority;
  fresh_[fresh_count_++] = node;
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
  f.stiffness = information.diagonal().maxCoeff();
  const int index = graph_.add_factor(f);
  for (const int n : {a, b})  // the factor that brought a new node here says where it is
    if (graph_.node(n).hung_from == kNone && !elimination_.contains(n) &&
        graph_.node(n).seniority > graph_.node(n == a ? b : a).seniority)
      graph_.node(n).hung_from = index;
  mark_dirty(index);
  objective_changed_ = true;
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
  stepper_.forget_step();
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
  objective_changed_ = true;
}

// Nodes that no elimination holds yet do not move with a step: they follow what they hang from.
template <class Space>
void PoseGraph<Space>::place_fresh_nodes() noexcept {
  for (int k = 0; k < fresh_count_; ++k) {
    Node<Space>& n = graph_.node(fresh_[k]);
    if (n.hung_from == kNone) continue;
    const Factor<Space>& f = graph_.factor(n.hung_from);
    n.pose = f.b == fresh_[k] ? Space::compose(graph_.node(f.a).pose, f.z)
                              : Space::compose(graph_.node(f.b).pose, Space::between(f.z, Pose{}));
  }
}

template <class Space>
void PoseGraph<Space>::start_job() noexcept {
  if (objective_changed_) stepper_.conclude();
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
  if (newest_ != kNone && graph_.node(newest_).first_incidence != kNone) {
    elimination_.touch(newest_);
    elimination_.keep_last(newest_);
  }
  elimination_.begin();
}

// The new columns did not fit. Once more without the garbage; then the new factors are set aside
// and counted, and the estimate goes on without them.
template <class Space>
void PoseGraph<Space>::overcome_overflow() noexcept {
  const bool again = elimination_.pool().live() < elimination_.pool().end();
  for (int k = 0; k < job_count_; ++k) {
    FactorState& s = graph_.factor(job_[k]).state;
    s.in_job = false;
    if (again) {
      mark_dirty(job_[k]);
    } else if (!s.integrated) {
      s.active = false;
      ++overflows_;
    }
  }
  job_count_ = 0;
  elimination_.compact();
}

template <class Space>
void PoseGraph<Space>::finish_job() noexcept {
  double change = 0.0;
  for (int k = 0; k < job_count_; ++k) {
    graph_.factor(job_[k]).state.in_job = false;
    change += std::abs(stepper_.evaluate(job_[k]));
  }
  job_count_ = 0;
  if (change > 1e-9) wants_step_ = true;
  if (objective_changed_) stepper_.forget_step();
  objective_changed_ = false;
  int kept = 0;
  for (int k = 0; k < fresh_count_; ++k) {
    if (elimination_.contains(fresh_[k])) {
      graph_.node(fresh_[k]).hung_from = kNone;
    } else {
      fresh_[kept++] = fresh_[k];
    }
  }
  fresh_count_ = kept;
}

template <class Space>
double PoseGraph<Space>::tolerance(bool idle) const noexcept {
  return idle ? 1e-8 * stepper_.chi2() + 1e-10 : 1e-5 * stepper_.chi2() + 1e-7;
}

template <class Space>
SolveReport PoseGraph<Space>::update(Deadline deadline, int max_iterations) noexcept {
  using Step = typename Stepper<Space>::Result;
  SolveReport report;
  const bool idle = dirty_count_ == 0 && !elimination_.busy();
  if (idle && !settled_) wants_step_ = true;
  for (;;) {
    if (!stepper_.busy()) {
      if (!elimination_.busy() && dirty_count_ > 0) start_job();
      if (elimination_.busy()) {
        const auto result = elimination_.run(deadline);
        if (result == Elimination<Space>::Result::kDeadline) {
          report.stop = Stop::kDeadline;
          break;
        }
        if (result == Elimination<Space>::Result::kFull) {
          overcome_overflow();
          continue;
        }
        finish_job();
        continue;
      }
      if (!wants_step_) break;
      if (report.iterations == max_iterations) {
        report.stop = Stop::kIterationLimit;
        break;
      }
    }
    const Step result = stepper_.step(deadline, tolerance(idle));
    if (result == Step::kDeadline) {
      report.stop = Stop::kDeadline;
      break;
    }
    if (result == Step::kMoved) {
      ++report.iterations;
      place_fresh_nodes();
      settled_ = false;
      // A step that gains little leaves much less behind: looking at it can wait.
      wants_step_ = idle || stepper_.predicted() > 1e-3 * stepper_.chi2();
    } else if (result == Step::kStale) {
      stepper_.take_stale([&](int f) { mark_dirty(f); });
    } else {
      wants_step_ = false;
      settled_ = settled_ || idle;
    }
  }
  report.chi2 = stepper_.chi2();
  return report;
}

// From scratch: Levenberg-Marquardt, everything linearised anew at each step.
template <class Space>
SolveReport PoseGraph<Space>::optimise(Deadline deadline, int max_iterations) noexcept {
  SolveReport report;
  double damping = 0.0;
  double now = -1.0;
  report.stop = Stop::kIterationLimit;
  while (report.iterations < max_iterations) {
    if (deadline.expired()) {
      report.stop = Stop::kDeadline;
      break;
    }
    ++report.iterations;
    if (elimination_.busy()) elimination_.abandon();
    elimination_.clear_job();
    elimination_.touch_all(damping);
    elimination_.begin();
    if (elimination_.run(Deadline::never()) != Elimination<Space>::Result::kCommitted) {
      ++overflows_;
      break;
    }
    for (int k = 0; k < dirty_count_; ++k) graph_.factor(dirty_[k]).state.dirty = false;
    dirty_count_ = 0;
    finish_job();
    if (now < 0.0) now = chi2();
    const double gain = stepper_.full_step();
    const double next = chi2();
    if (next <= now * (1.0 + 1e-12) + 1e-12) {
      const double gained = now - next;
      now = next;
      damping = damping < 1e-7 ? 0.0 : 0.1 * damping;
      if (gain > 1e-9 * now + 1e-12 || gained > 1e-9 * now + 1e-12) continue;
      report.stop = Stop::kConverged;
      break;
    }
    stepper_.restore();
    now = chi2();
    if (gain <= 1e-9 * now) {
      report.stop = Stop::kConverged;
      break;
    }
    damping = std::max(10.0 * damping, 1e-6);
    if (damping > 1e8) break;
  }
  wants_step_ = false;
  settled_ = true;
  stepper_.forget_step();
  report.chi2 = now;
  return report;
}

template class PoseGraph<PlanarSpace>;
template class PoseGraph<SpatialSpace>;

}  // namespace maplet
