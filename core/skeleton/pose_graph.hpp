// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/skeleton/elimination.hpp"
#include "core/skeleton/graph.hpp"
#include "core/skeleton/stepper.hpp"

namespace maplet {

struct PoseGraphLimits {
  int max_nodes = 0;
  int max_factors = 0;
  int max_blocks = 0;  ///< of the Cholesky factor, the old and the new one together
};

/// How much the estimate may lag behind between updates that find nothing new (idle ones converge).
struct SolvePolicy {
  /// New factors wait for elimination while their chi2 sums up to less than this share of the
  /// whole.
  double defer_share = 0.2;
  /// No step is made that gains a smaller share of chi2, or less chi2 than that.
  double step_share = 1e-3;
  double step_gain = 1e-6;
  /// Limit of one update, in units of Allowance; the rest is carried over. 0: 2 ms or 3 (space).
  /// When idle half as much again.
  std::int64_t work_per_update = 0;
};

/// How far the estimate came.
struct SolveReport {
  Stop stop = Stop::kConverged;
  int iterations = 0;
  double chi2 = 0.0;  ///< sum of weight * e^T information e, as last evaluated
};

/// Nodes, factors and the incremental solver: the skeleton's engine, one Space at a time.
///
/// The poses held are always the estimate itself, never a linearisation point with a correction
/// beside it. Each step solves with the exact gradient and a factor whose Hessian may be stale: a
/// stale one costs convergence, not accuracy, and goes stale only where *relative* poses changed.
///
/// Memory   fixed by PoseGraphLimits, from the arena.
/// Time     adding O(1); update until its deadline, the rest is carried over to the next call.
/// Math     docs/math/skeleton.md.
template <class Space>
class PoseGraph {
 public:
  static constexpr int kNone = -1;
  using Pose = typename Space::Pose;
  using Tangent = typename Space::Tangent;
  using Block = typename Space::Block;

  PoseGraph(const PoseGraphLimits& limits, Arena& arena, const SolvePolicy& policy = {});

  /// A node on its own: a new group, of which it is the gauge. @pre !graph().nodes_full()
  int add_node(const Pose& pose, Seniority seniority) noexcept;
  /// The measurement T_a_b = z. Groups that it joins become one: the junior one moves to fit. The
  /// most senior node of a group is its gauge, at the identity once it has measurements.
  /// @param information  positive definite  @pre !graph().factors_full()
  /// @param weight  0: it is only remembered, until set_weight
  int add_between(int a, int b, const Pose& z, const Block& information,
                  double weight = 1.0) noexcept;
  /// A point in a's group, at `at` in a's frame: a node whose position alone is estimated.
  /// @pre !graph().nodes_full()
  int add_point(int a, const Pose& at) noexcept;
  /// A point that nothing is known about yet, on its own: connect() or FrameFinder place it.
  int add_point() noexcept;
  /// A range, bearing or position of b as a sees it (measure.hpp says how z and the information's
  /// rows read). Between groups it waits, without effect, until something else joins them.
  int add_sight(FactorKind kind, int a, int b, const Pose& z, const Block& information,
                double weight = 1.0) noexcept;
  /// Where a is in the world. A group with priors is held by them instead of by its gauge.
  int add_prior(int a, const Pose& z, const Block& information, double weight = 1.0) noexcept;
  /// Makes the groups of a and b one, the junior one moved so that T_a_b holds.
  void connect(int a, int b, const Pose& T_a_b) noexcept;
  /// Scales a factor's information from now on; 0 switches it off. One that was off and joins two
  /// groups does so now; what it alone held together comes apart into two groups again.
  void set_weight(int factor, double weight) noexcept;

  /// A factor, a node whose factors are retired, that counts no more and is to be freed.
  void retire_factor(int factor) noexcept;
  void retire_node(int node) noexcept;
  /// Eliminates what waits and frees what is retired; factors first.
  void free_retired_factors() noexcept;
  void free_retired_nodes() noexcept;
  /// Calls visit(index) for each factor freed since the last call. Some may have been taken anew.
  template <class Visit>
  void take_freed(Visit&& visit) noexcept {
    for (int k = 0; k < freed_count_; ++k) visit(freed_[k]);
    freed_count_ = 0;
  }

  /// Anytime: eliminates what changed, then steps until nothing gains any more. After new input
  /// within the policy's shares; called again without any (idle), until it has converged.
  SolveReport update(Deadline deadline, int max_iterations = 100) noexcept;
  /// Gauss-Newton steps, everything linearised anew, until none moves a node by more than `step`
  /// (m, rad). @return whether it got there
  bool polish(double step, int max_iterations = 20) noexcept;
  /// From scratch: Levenberg-Marquardt with everything linearised anew at each step.
  SolveReport optimise(Deadline deadline, int max_iterations = 100) noexcept;

  /// Whether the estimate fits as its measurements' own noise says that it should: neither worse,
  /// nor so well that their noise says nothing. @pre chi2 is up to date
  [[nodiscard]] bool fits() const noexcept;
  /// A start that no earlier estimate can lead astray: rotations by a linear relaxation, then
  /// positions given them, a limited amount of work a call; update() goes on from there.
  /// @pre between its calls nothing else is called
  /// @return kConverged: the start is made. kDeadline: call again. kIterationLimit, and no pose
  ///   changed: there are sights in the graph, or the factor does not fit
  Stop start_anew(Deadline deadline) noexcept;

  [[nodiscard]] const Graph<Space>& graph() const noexcept { return graph_; }
  [[nodiscard]] Graph<Space>& graph() noexcept { return graph_; }
  [[nodiscard]] const Elimination<Space>& elimination() const noexcept { return elimination_; }
  [[nodiscard]] int group(int node) const noexcept { return graph_.node(node).group; }
  /// Sum of weight * e^T information e at the present estimate, evaluated afresh.
  [[nodiscard]] double chi2() noexcept {
    stepper_.evaluate_all();
    return stepper_.chi2();
  }
  /// As last evaluated.
  [[nodiscard]] double last_chi2() const noexcept { return stepper_.chi2(); }
  /// Eliminates what waits, whatever it is worth: all nodes with factors are in the factor then.
  /// @return false when the deadline passed before: call again
  bool flush(Deadline deadline = Deadline::never()) noexcept;
  /// No step has been made since the factors were last evaluated.
  [[nodiscard]] bool up_to_date() const noexcept {
    return !stepper_.busy() && !stepper_.unverified() && !elimination_.busy();
  }
  /// Nothing waits and no step gains any more.
  [[nodiscard]] bool settled() const noexcept {
    return settled_ && !new_input_ && dirty_count_ == 0 && !elimination_.busy() && !stepper_.busy();
  }
  /// Factors set aside because their elimination did not fit in the pool of blocks.
  [[nodiscard]] std::uint64_t overflows() const noexcept { return overflows_; }
  /// Those count again.
  void recall_set_aside() noexcept;
  /// Eliminations depend on the graph and its nodes' seniority alone, not on who came first, from
  /// now on, and begin from nothing; or no longer. @pre no node comes or goes in between
  void order_by_seniority(bool on) noexcept;

 private:
  void mark_dirty(int factor) noexcept;
  [[nodiscard]] std::int64_t newest_arrival() const noexcept {
    return newest_ == kNone ? -1 : graph_.node(newest_).arrival;
  }
  int add_factor(FactorKind kind, int a, int b, const Pose& z, const Block& information,
                 double weight) noexcept;
  void link_in(int factor) noexcept;
  void hold_by_prior(int factor) noexcept;
  void release_prior(int factor) noexcept;
  void hang(int node, int from, int factor) noexcept;
  void split_if_apart(int a, int b) noexcept;
  [[nodiscard]] int reach(int from) noexcept;
  void join_groups(int a, int b, const Pose& z) noexcept;
  void move_group(int gauge, int new_gauge, const Pose& by) noexcept;
  void appoint_gauge(int node) noexcept;
  void begin_job() noexcept;
  void start_job() noexcept;
  void start_fresh_job(double damping, Model model = Model::kExact) noexcept;
  void begin_relaxed(Model model) noexcept;
  void turn_relaxed() noexcept;
  void place_relaxed() noexcept;
  void finish_job() noexcept;
  void drop_columns() noexcept;
  void overcome_overflow() noexcept;
  void set_factors_aside() noexcept;
  [[nodiscard]] int gather_spare_links() noexcept;
  void place_fresh_nodes() noexcept;
  [[nodiscard]] int support(int node) const noexcept;
  void hang_anew() noexcept;
  void relax(int node) noexcept;
  [[nodiscard]] double tolerance(bool idle) const noexcept;
  [[nodiscard]] bool any_stale() const noexcept;
  [[nodiscard]] bool due(bool idle) const noexcept;

  Graph<Space> graph_;
  Elimination<Space> elimination_;
  Stepper<Space> stepper_;
  std::span<int> dirty_;  ///< factors that wait for elimination
  std::span<int> job_;    ///< factors of the job under way
  std::span<int> fresh_;  ///< nodes that are not eliminated yet, in order of arrival
  std::span<int> retired_factors_;
  std::span<int> retired_nodes_;
  std::span<int> stack_;             ///< of a search
  std::span<std::int64_t> reached_;  ///< by the search of this number
  std::int64_t searches_ = 0;
  std::span<int> freed_;  ///< factors, since they were last asked for
  int retired_factor_count_ = 0;
  int retired_node_count_ = 0;
  int freed_count_ = 0;
  int dirty_count_ = 0;
  int job_count_ = 0;
  int fresh_count_ = 0;
  int newest_ = kNone;  ///< last come of the nodes with a factor
  std::int64_t arrivals_ = 0;
  SolvePolicy policy_;
  double pending_ = 0.0;  ///< chi2 of factors that wait for elimination
  bool new_input_ = false;
  bool fresh_job_ = false;  ///< the job under way linearises everything
  bool flushing_ = false;
  bool by_seniority_ = false;
  Model relaxed_ = Model::kExact;  ///< of a new start under way
  bool job_first_ = false;         ///< before the next step
  bool refresh_ = false;           ///< everything is to be linearised anew, when idle
  bool objective_changed_ = false;
  bool job_changes_objective_ = false;
  bool wants_step_ = false;
  bool settled_ = true;
  std::uint64_t overflows_ = 0;
};

extern template class PoseGraph<PlanarSpace>;
extern template class PoseGraph<SpatialSpace>;

}  // namespace maplet
