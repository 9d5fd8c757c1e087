// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/skeleton/allowance.hpp"
#include "core/skeleton/elimination.hpp"
#include "core/skeleton/graph.hpp"

namespace maplet {

/// Moves the estimate downhill: exact gradient, two triangular solves with the factor at hand, a
/// guarded move. Each part touches only what changed: factors of nodes that moved, paths of nodes
/// with a gradient, subtrees that the step reaches.
///
/// Memory   fixed, from the arena.
/// Time     step() stops at the deadline in any of its phases and goes on from there when called
///          again; only the move itself is not divided.
/// Math     docs/math/skeleton.md, section 5.
template <class Space>
class Stepper {
 public:
  static constexpr int kNone = -1;
  static constexpr int kDim = Space::kDim;
  static constexpr int kFactorWork = kDim == 6 ? 20 : 6;  ///< of evaluating a factor
  static constexpr int kColumnWork = kDim == 6 ? 3 : 1;   ///< of solving with a column, a block
  using Tangent = typename Space::Tangent;

  enum class Result : std::uint8_t {
    kDeadline,   ///< in the middle; call again
    kMoved,      ///< a step was made
    kConverged,  ///< no step gains more than the tolerance
    kStale,      ///< the last step was poor: take_stale(), eliminate, call again
    kMisled,     ///< it gained far less than promised: what is stale must be linearised anew
    kStuck,      ///< no step along the direction gains anything
  };

  Stepper(Graph<Space>& graph, const Elimination<Space>& elimination, Arena& arena);

  /// Brings a factor's error and gradient up to date. @return how much weight * chi2 changed
  double evaluate(int factor) noexcept;
  void evaluate_all() noexcept;
  /// As evaluate, of a factor that has just been eliminated: no step's model is judged by it.
  double evaluate_new(int factor) noexcept {
    const double loss = loss_;
    loss_ = -1.0;
    const double change = evaluate(factor);
    loss_ = loss;
    return change;
  }
  /// Takes a factor's share out; it is about to be removed or switched off.
  void withdraw(int factor) noexcept;
  /// The objective changed (factors, weights, groups): lows so far do not compare with what
  /// follows.
  void forget_step() noexcept;
  /// A node is taken out. @pre nothing waits for evaluation, no step is under way
  void forget_node(int node) noexcept {
    const bool seed = state_[node].seed;  // it is in the list
    state_[node] = {};
    state_[node].seed = seed;
  }
  /// Evaluates the factors that the last step moved. @return false when the allowance is spent
  bool catch_up(Allowance& allowance) noexcept;
  /// To call before the objective changes: leaves no step behind that has made things worse.
  /// @pre caught up
  void conclude() noexcept;
  /// To call before everything is linearised anew: not where a step went astray. @pre caught up
  void come_back() noexcept;
  /// Everything was linearised where the estimate stands: what earlier steps showed of the factor
  /// is past.
  void trust_factor() noexcept {
    distrust_nothing();
    misjudges_ = false;
    since_refresh_ = 0;
  }

  /// Works towards one step. @param tolerance  gain (in chi2) below which no step is made
  [[nodiscard]] Result step(Allowance& allowance, double tolerance) noexcept;
  /// A whole step without guard and pruning. @return its predicted gain
  double full_step() noexcept;
  /// Solves with the factor at hand for right sides of anyone's making; what was known of gradients
  /// and steps is lost: evaluate_all. @param right_side  Tangent(node)
  /// @param take  void(node, const Tangent&), of every node that is eliminated
  template <class RightSide, class Take>
  void solve_all(RightSide&& right_side, Take&& take) noexcept {
    forget_step();
    for (int i = 0; i < graph_.node_end(); ++i)
      if (graph_.node(i).used) state_[i].gradient = right_side(i);
    prune_ = 0.0;
    mark_paths(-1.0);
    sequence_marked();
    for (int k = sequence_count_; k > 0;) forward_one(sequence_[--k]);
    start_backward();
    Allowance unlimited = Allowance::unlimited();
    (void)backward(unlimited);
    for (int k = 0; k < sequence_count_; ++k) take(sequence_[k], state_[sequence_[k]].delta);
  }
  /// Two of such solutions, until the next step; they take the place of its vectors.
  void keep(int node, bool second, const Tangent& solution) noexcept {
    (second ? state_[node].step : state_[node].direction) = solution;
  }
  [[nodiscard]] const Tangent& kept(int node, bool second) const noexcept {
    return second ? state_[node].step : state_[node].direction;
  }
  /// The largest of the last step's entries, m or rad.
  [[nodiscard]] double largest_step() const noexcept {
    double most = 0.0;
    for (int k = 0; k < moved_count_; ++k)
      most = std::max(most, state_[moved_[k]].step.cwiseAbs().maxCoeff());
    return most;
  }
  /// Undoes the last full step.
  void restore() noexcept { back_to_reference(); }
  /// In the middle of a step: the elimination must stay as it is.
  [[nodiscard]] bool busy() const noexcept { return phase_ != Phase::kIdle; }
  /// Factors wait for evaluation: the last step has not been looked at.
  [[nodiscard]] bool unverified() const noexcept { return queue_count_ > 0; }
  /// Calls mark(factor) for the factors that the last evaluation found worth linearising anew.
  template <class Mark>
  void take_stale(Mark&& mark) noexcept {
    for (int k = 0; k < stale_count_; ++k) {
      graph_.factor(stale_[k]).state.stale = false;
      mark(stale_[k]);
    }
    stale_count_ = 0;
  }
  [[nodiscard]] bool has_stale() const noexcept { return stale_count_ > 0; }

  [[nodiscard]] double chi2() const noexcept { return chi2_; }
  /// gradient^T H^-1 gradient of the last step's start (eq. 11).
  [[nodiscard]] double predicted() const noexcept { return predicted_; }

 private:
  static constexpr int kPatience = 4;          ///< steps that may pass without a new low
  static constexpr double kFar = 100.0;        ///< times the low: taken back at once
  static constexpr double kLost = 1e6;         ///< times the low: all sums anew
  static constexpr double kLeastScale = 1e-3;  ///< shorter steps than that are none

  enum class Phase : std::uint8_t { kIdle, kEvaluate, kForward, kBackward, kMove };

  void queue(int factor) noexcept;
  void note_staleness(int factor, const typename Space::Pose& rel, const Tangent& before) noexcept;
  void take_reference() noexcept;
  void back_to_reference() noexcept;
  void add_gradient(int node, const Tangent& change) noexcept;
  void mark_paths(double threshold) noexcept;
  void sequence_marked() noexcept;
  void forward_one(int node) noexcept;
  /// @return whether anything below may move
  bool backward_one(int node, double threshold) noexcept;
  void start_backward() noexcept;
  bool backward(Allowance& allowance) noexcept;
  void aim() noexcept;
  [[nodiscard]] double curvature() noexcept;
  void move() noexcept;
  [[nodiscard]] Result judge(double tolerance) noexcept;
  void distrust_nothing() noexcept {
    last_power_ = expected_ = loss_ = 0.0;
    careful_ = false;
  }

  struct State {  // of a node
    Tangent gradient = Tangent::Zero();
    Tangent delta = Tangent::Zero();      ///< preconditioned gradient, in the making or made
    Tangent direction = Tangent::Zero();  ///< of the last step
    Tangent step = Tangent::Zero();       ///< that step itself
    std::int64_t marked = 0;              ///< on a path of this step
    std::int64_t moved = 0;               ///< has a delta in this step
    std::int64_t aimed = 0;               ///< has a direction in this step
    bool seed = false;                    ///< in seeds_
    bool saved = false;                   ///< in saved_: its backup is its pose at the reference
  };

  Graph<Space>& graph_;
  const Elimination<Space>& elimination_;
  std::span<State> state_;
  std::span<int> seeds_;     ///< nodes whose gradient changed since they were last solved for
  std::span<int> sequence_;  ///< marked nodes, parents first
  std::span<int> moved_;     ///< by the last step
  std::span<int> earlier_;   ///< by the one before
  std::span<int> saved_;     ///< nodes moved since the reference
  std::span<int> queue_;     ///< factors to evaluate
  std::span<int> stale_;     ///< factors to linearise anew
  std::span<int> roots_;     ///< of marked paths
  int seed_count_ = 0;
  int sequence_count_ = 0;
  int moved_count_ = 0;
  int earlier_count_ = 0;
  int queue_count_ = 0;
  int stale_count_ = 0;
  int root_count_ = 0;
  int saved_count_ = 0;
  int since_reference_ = 0;
  int since_refresh_ = 0;  ///< steps since everything was linearised anew
  int cursor_ = 0;
  int root_cursor_ = 0;
  int walk_ = kNone;  ///< backward's place in the tree
  std::int64_t stamp_ = 0;
  Phase phase_ = Phase::kIdle;
  double chi2_ = 0.0;
  double reference_ = -1.0;  ///< lowest chi2 so far; < 0: none, as the elimination changed
  double loss_ = 0.0;        ///< what the linear model missed in the last step, whitened
  double stale_above_ = 0.0;
  double last_chi2_ = 0.0;  ///< before the last step
  std::int64_t last_stamp_ = -1;
  double predicted_ = 0.0;
  double last_power_ = 0.0;  ///< predicted_ of the step before, while directions conjugate
  double expected_ = 0.0;    ///< decrease of chi2 that the last step's model promised
  bool misjudges_ = false;   ///< its curvature along the last direction was far off
  bool careful_ = false;     ///< the factor at hand is too stale for its steps to be believed
  double prune_ = 0.0;
  double scale_ = 1.0;
};

extern template class Stepper<PlanarSpace>;
extern template class Stepper<SpatialSpace>;

}  // namespace maplet
