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
  double defer_share = 0.05;
  /// No step is made that gains a smaller share of chi2, or less chi2 than that.
  double step_share = 1e-3;
  double step_gain = 1e-6;
  /// Limit of one update, in units of Allowance; the rest is carried over. 0: 2 ms or 3 (space).
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
  /// Scales a factor's information from now on; 0 switches it off. One that was off and joins two
  /// groups does so now.
  void set_weight(int factor, double weight) noexcept;

  /// Anytime: eliminates what changed, then steps until nothing gains any more. After new input
  /// within the policy's shares; called again without any (idle), until it has converged.
  SolveReport update(Deadline deadline, int max_iterations = 100) noexcept;
  /// From scratch: Levenberg-Marquardt with everything linearised anew at each step.
  SolveReport optimise(Deadline deadline, int max_iterations = 100) noexcept;

  [[nodiscard]] const Graph<Space>& graph() const noexcept { return graph_; }
  [[nodiscard]] Graph<Space>& graph() noexcept { return graph_; }
  [[nodiscard]] const Elimination<Space>& elimination() const noexcept { return elimination_; }
  [[nodiscard]] int group(int node) const noexcept { return graph_.node(node).group; }
  /// Sum of weight * e^T information e at the present estimate, evaluated afresh.
  [[nodiscard]] double chi2() noexcept {
    stepper_.evaluate_all();
    return stepper_.chi2();
  }
  /// Eliminates what waits, whatever it is worth: all nodes with factors are in the factor then.
  void flush() noexcept;
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

 private:
  void mark_dirty(int factor) noexcept;
  void link_in(int factor) noexcept;
  void join_groups(int a, int b, const Pose& z) noexcept;
  void move_group(int gauge, int new_gauge, const Pose& by) noexcept;
  void appoint_gauge(int node) noexcept;
  void begin_job() noexcept;
  void start_job() noexcept;
  void start_fresh_job(double damping) noexcept;
  void finish_job() noexcept;
  void overcome_overflow() noexcept;
  void set_factors_aside() noexcept;
  void place_fresh_nodes() noexcept;
  [[nodiscard]] int support(int node) const noexcept;
  void hang_anew() noexcept;
  void relax(int node) noexcept;
  [[nodiscard]] double tolerance(bool idle) const noexcept;
  void relinearise() noexcept;
  [[nodiscard]] bool any_stale() const noexcept;
  [[nodiscard]] bool due(bool idle) const noexcept;

  Graph<Space> graph_;
  Elimination<Space> elimination_;
  Stepper<Space> stepper_;
  std::span<int> dirty_;  ///< factors that wait for elimination
  std::span<int> job_;    ///< factors of the job under way
  std::span<int> fresh_;  ///< nodes that are not eliminated yet, in order of arrival
  int dirty_count_ = 0;
  int job_count_ = 0;
  int fresh_count_ = 0;
  int newest_ = kNone;
  SolvePolicy policy_;
  double pending_ = 0.0;  ///< chi2 of factors that wait for elimination
  bool new_input_ = false;
  bool fresh_job_ = false;  ///< the job under way linearises everything
  int misled_ = 0;          ///< steps that gained too little, since the last convergence
  bool flushing_ = false;
  bool job_first_ = false;  ///< before the next step
  bool refresh_ = false;    ///< everything is to be linearised anew, when idle
  bool objective_changed_ = false;
  bool job_changes_objective_ = false;
  bool wants_step_ = false;
  bool settled_ = true;
  std::uint64_t overflows_ = 0;
};

extern template class PoseGraph<PlanarSpace>;
extern template class PoseGraph<SpatialSpace>;

}  // namespace maplet
