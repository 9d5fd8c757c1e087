// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/pose_graph.hpp"

#include <algorithm>
#include <cmath>
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
      policy_{policy} {
  if (policy_.work_per_update == 0) policy_.work_per_update = Space::kDim == 6 ? 160'000 : 100'000;
}

template <class Space>
int PoseGraph<Space>::add_node(const Pose& pose, Seniority seniority) noexcept {
  const int node = graph_.add_node(pose);
  graph_.node(node).seniority = seniority;
  fresh_[fresh_count_++] = node;
  return node;
}

template <class Space>
int PoseGraph<Space>::add_between(int a, int b, const Pose& z, const Block& information,
                                  double weight) noexcept {
  Factor<Space> f;
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
  newest_ = std::max({a, b, newest_});
  new_input_ = true;
  if (weight > 0.0) link_in(index);
  return index;
}

// A factor begins to count: its nodes are of one group from now on.
template <class Space>
void PoseGraph<Space>::link_in(int factor) noexcept {
  Factor<Space>& f = graph_.factor(factor);
  for (const int n : {f.a, f.b}) {
    Node<Space>& gauge = graph_.node(graph_.node(n).group);
    if (gauge.anchor == 0.0) gauge.anchor = kAnchorStiffness * f.stiffness;
  }
  if (graph_.node(f.a).group != graph_.node(f.b).group) join_groups(f.a, f.b, f.z);
  appoint_gauge(f.a);
  appoint_gauge(f.b);
  f.state.active = true;
  for (const int n : {f.a, f.b}) {  // the factor that brought a new node here says where it is
    const int other = n == f.a ? f.b : f.a;
    if (graph_.node(n).hung_from == kNone && !elimination_.contains(n) &&
        graph_.node(n).seniority > graph_.node(other).seniority) {
      graph_.node(n).hung_from = factor;
      graph_.node(n).backup = Space::between(graph_.node(other).pose, graph_.node(n).pose);
    }
  }
  mark_dirty(factor);
  const typename Space::Tangent e = Space::error(f.z, relative_pose(graph_, f));
  pending_ += f.weight * e.dot(weigh(f, e));
  objective_changed_ = new_input_ = true;
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
  Factor<Space>& f = graph_.factor(factor);
  if (weight == f.weight && f.state.active == (weight > 0.0)) return;
  const double before = f.weight;
  f.weight = weight;
  if (weight > 0.0 && !f.state.active) return link_in(factor);
  pending_ += std::abs(weight - before) * f.chi2;
  if (weight == 0.0) {
    stepper_.withdraw(factor);
    f.state.active = false;
  }
  mark_dirty(factor);
  objective_changed_ = new_input_ = true;
}

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
  if (n.hung_from == kNone) return;
  Block h = Block::Zero();
  Tangent g = Tangent::Zero();
  int factors = 0;
  const auto cost = [&](auto&& each) {
    double sum = 0.0;
    graph_.for_each_incident(node, [&](int index, int other) {
      const Factor<Space>& f = graph_.factor(index);
      if (other == kNone || !f.state.active || f.weight == 0.0) return;
      const Pose rel = relative_pose(graph_, f);
      const Tangent e = Space::error(f.z, rel);
      const Tangent v = weigh(f, e);
      sum += f.weight * e.dot(v);
      each(f, rel, e, v);
    });
    return sum;
  };
  const double before =
      cost([&](const Factor<Space>& f, const Pose& rel, const Tangent& e, const Tangent& v) {
        Tangent by_a, by_b;
        Space::pull_back(f.z, rel, e, -f.weight * v, by_a, by_b);
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

// Everything anew, in one job: all factors linearised where they stand, no rounding carried over.
template <class Space>
void PoseGraph<Space>::start_fresh_job(double damping) noexcept {
  begin_job();
  for (int k = 0; k < dirty_count_; ++k) graph_.factor(dirty_[k]).state.dirty = false;
  job_count_ = dirty_count_ = 0;
  for (int i = 0; i < graph_.factor_end(); ++i) {
    FactorState& s = graph_.factor(i).state;
    if (!s.active && !s.integrated) continue;
    s.in_job = true;
    job_[job_count_++] = i;
  }
  fresh_job_ = true;
  elimination_.touch_all(damping);
  if (newest_ != kNone) elimination_.keep_last(newest_);
  elimination_.begin();
}

template <class Space>
void PoseGraph<Space>::begin_job() noexcept {
  if (objective_changed_) stepper_.conclude();
  hang_anew();
  job_changes_objective_ = objective_changed_;
  objective_changed_ = false;
  pending_ = 0.0;
  elimination_.clear_job();
}

template <class Space>
void PoseGraph<Space>::start_job() noexcept {
  begin_job();
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

// The new columns did not fit. Once more without the garbage; then without the old columns, which
// costs the steps until the job is done; then with fewer factors, those set aside counted.
template <class Space>
void PoseGraph<Space>::overcome_overflow() noexcept {
  const bool garbage = elimination_.pool().live() < elimination_.pool().end();
  const bool old_columns = elimination_.pool().live() > 0;
  for (int k = 0; k < job_count_; ++k) {
    graph_.factor(job_[k]).state.in_job = false;
    if (!fresh_job_) mark_dirty(job_[k]);
  }
  job_count_ = 0;
  refresh_ = fresh_job_ || !garbage;
  fresh_job_ = false;
  job_first_ = true;
  objective_changed_ = objective_changed_ || job_changes_objective_;
  if (garbage) {
    elimination_.compact();
  } else if (old_columns) {
    elimination_.clear();
    for (int i = 0; i < graph_.factor_end(); ++i) graph_.factor(i).state.integrated = false;
  } else {
    set_factors_aside();
  }
}

// An eighth of the factors, the newest that no node hangs by.
template <class Space>
void PoseGraph<Space>::set_factors_aside() noexcept {
  int wanted = std::max(1, graph_.factor_count() / 8);
  for (int i = graph_.factor_end() - 1; i >= 0 && wanted > 0; --i) {
    Factor<Space>& f = graph_.factor(i);
    if (!f.state.active) continue;
    int oldest = i;
    graph_.for_each_incident(std::max(f.a, f.b),
                             [&](int at, int) { oldest = std::min(oldest, at); });
    if (oldest == i) continue;
    f.state.active = false;
    stepper_.withdraw(i);
    ++overflows_;
    --wanted;
  }
}

template <class Space>
void PoseGraph<Space>::finish_job() noexcept {
  double change = 0.0;
  for (int k = 0; k < job_count_; ++k) {
    graph_.factor(job_[k]).state.in_job = false;
    change += std::abs(stepper_.evaluate_new(job_[k]));
  }
  job_count_ = 0;
  if (change > 1e-9 || fresh_job_) wants_step_ = true;
  if (fresh_job_) stepper_.distrust_nothing();
  fresh_job_ = false;
  if (job_changes_objective_) stepper_.forget_step();
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
  return idle ? 1e-8 * stepper_.chi2() + 1e-10
              : std::max(policy_.step_share * stepper_.chi2(), policy_.step_gain);
}

// The last step gained far less than the factor at hand promised: what is stale in it goes into the
// next job; where that is much of everything, all of it does.
template <class Space>
void PoseGraph<Space>::relinearise() noexcept {
  constexpr double kShare = 0.2;  // of the stalest
  const auto staleness = [&](const Factor<Space>& f) {
    if (!f.state.active || !f.state.integrated) return 0.0;
    return Space::staleness(relative_pose(graph_, f), f.rel_lin);
  };
  double most = 1e-4;
  for (int i = 0; i < graph_.factor_end(); ++i) most = std::max(most, staleness(graph_.factor(i)));
  for (int i = 0; i < graph_.factor_end(); ++i)
    if (staleness(graph_.factor(i)) > kShare * most) mark_dirty(i);
  refresh_ = dirty_count_ > graph_.factor_count() / 4 || dirty_count_ == 0;
  pending_ = std::max(pending_, policy_.defer_share * stepper_.chi2());
}

template <class Space>
bool PoseGraph<Space>::any_stale() const noexcept {
  constexpr double kStale = 1e-3;
  for (int i = 0; i < graph_.factor_end(); ++i) {
    const Factor<Space>& f = graph_.factor(i);
    if (f.state.active && f.state.integrated &&
        Space::staleness(relative_pose(graph_, f), f.rel_lin) > kStale)
      return true;
  }
  return false;
}

// Whether what waits is worth an elimination.
template <class Space>
bool PoseGraph<Space>::due(bool idle) const noexcept {
  if (dirty_count_ == 0) return false;
  return idle || job_first_ || flushing_ ||
         !(pending_ < std::max(policy_.defer_share * stepper_.chi2(), 5.0 * policy_.step_gain));
}

template <class Space>
void PoseGraph<Space>::flush() noexcept {
  flushing_ = true;
  for (int k = 0; k < 1000 && (dirty_count_ > 0 || elimination_.busy()); ++k) {
    job_first_ = true;
    new_input_ = true;
    (void)update(Deadline::never());
  }
  flushing_ = false;
}

template <class Space>
SolveReport PoseGraph<Space>::update(Deadline deadline, int max_iterations) noexcept {
  using Step = typename Stepper<Space>::Result;
  Allowance allowance{deadline, policy_.work_per_update};
  SolveReport report;
  const bool idle = !new_input_;
  // Where a step has just been made and not been looked at, nothing is to be fitted.
  if (new_input_ && !stepper_.unverified() && !elimination_.contains(newest_)) relax(newest_);
  new_input_ = false;
  if (idle && !settled_) wants_step_ = true;
  for (;;) {
    if (elimination_.busy()) {
      const auto result = elimination_.run(allowance);
      if (result == Elimination<Space>::Result::kDeadline) {
        report.stop = Stop::kDeadline;
        break;
      }
      if (result == Elimination<Space>::Result::kFull) {
        overcome_overflow();
      } else {
        finish_job();
      }
      continue;
    }
    // What has been begun is brought to its end before anything new comes in: else steps that
    // made things worse would never be judged.
    if (!stepper_.busy() && (job_first_ || !wants_step_) && (due(idle) || refresh_)) {
      if (!stepper_.catch_up(allowance)) {
        report.stop = Stop::kDeadline;
        break;
      }
      job_first_ = false;
      if (std::exchange(refresh_, false)) {
        start_fresh_job(0.0);
      } else {
        start_job();
      }
      continue;
    }
    if (!stepper_.busy() && !wants_step_) break;
    if (report.iterations == max_iterations) {
      report.stop = Stop::kIterationLimit;
      break;
    }
    const Step result = stepper_.step(allowance, tolerance(idle));
    if (result == Step::kDeadline) {
      report.stop = Stop::kDeadline;
      break;
    }
    place_fresh_nodes();  // a move was made, or taken back
    if (result == Step::kMoved) {
      ++report.iterations;
      settled_ = false;
      if (idle && any_stale()) refresh_ = job_first_ = true;
      // A step that gains little leaves much less behind: looking at it can wait.
      wants_step_ = idle || stepper_.predicted() > 3.0 * tolerance(false);
    } else if (result == Step::kStale) {
      stepper_.take_stale([&](int f) { mark_dirty(f); });
      pending_ = std::max(pending_, policy_.defer_share * stepper_.chi2());
      job_first_ = true;
    } else if (result == Step::kMisled) {
      relinearise();
      refresh_ = refresh_ || ++misled_ > 1;
      job_first_ = true;
    } else {
      wants_step_ = false;
      misled_ = 0;
      settled_ = settled_ || idle;
    }
  }
  if (dirty_count_ > 0) settled_ = false;
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
    for (int k = 0; k < job_count_; ++k) graph_.factor(job_[k]).state.in_job = false;
    start_fresh_job(damping);
    Allowance unlimited = Allowance::unlimited();
    if (elimination_.run(unlimited) != Elimination<Space>::Result::kCommitted) {
      ++overflows_;
      break;
    }
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
