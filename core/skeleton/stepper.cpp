// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The course of a step: evaluate, judge the last move, solve, move. stepper_solve.cpp has the
// parts.
#include "core/skeleton/stepper.hpp"

#include <algorithm>
#include <cmath>

#include "core/skeleton/linearise.hpp"

namespace maplet {

template <class Space>
Stepper<Space>::Stepper(Graph<Space>& graph, const Elimination<Space>& elimination, Arena& arena)
    : graph_{graph},
      elimination_{elimination},
      state_{arena.make_array<State>(graph.max_nodes(), "skeleton/vectors")},
      seeds_{arena.make_array<int>(graph.max_nodes(), "skeleton/vectors")},
      sequence_{arena.make_array<int>(graph.max_nodes(), "skeleton/vectors")},
      moved_{arena.make_array<int>(graph.max_nodes(), "skeleton/vectors")},
      earlier_{arena.make_array<int>(graph.max_nodes(), "skeleton/vectors")},
      saved_{arena.make_array<int>(graph.max_nodes(), "skeleton/vectors")},
      queue_{arena.make_array<int>(graph.max_factors(), "skeleton/queues")},
      stale_{arena.make_array<int>(graph.max_factors(), "skeleton/queues")},
      roots_{arena.make_array<int>(graph.max_nodes(), "skeleton/vectors")} {}

template <class Space>
void Stepper<Space>::queue(int factor) noexcept {
  FactorState& s = graph_.factor(factor).state;
  if (s.queued || !s.active || !s.integrated) return;
  s.queued = true;
  queue_[queue_count_++] = factor;
}

template <class Space>
void Stepper<Space>::forget_step() noexcept {
  phase_ = Phase::kIdle;
  take_reference();
  reference_ = -1.0;
  loss_ = 0.0;
  distrust_nothing();
}

template <class Space>
bool Stepper<Space>::catch_up(Allowance& allowance) noexcept {
  while (queue_count_ > 0) {
    if (allowance.spend(kFactorWork)) return false;
    const int f = queue_[--queue_count_];
    graph_.factor(f).state.queued = false;
    evaluate(f);
  }
  return true;
}

template <class Space>
void Stepper<Space>::conclude() noexcept {
  if (reference_ >= 0.0 && saved_count_ > 0 && !(chi2_ <= reference_)) back_to_reference();
  take_reference();
}

template <class Space>
void Stepper<Space>::come_back() noexcept {
  constexpr double kNothing = 1e-6;
  if (reference_ < 0.0 || saved_count_ == 0 || chi2_ < kFar * reference_ + kNothing) return;
  back_to_reference();
  scale_ *= 0.125;  // and twice that at the next look
}

template <class Space>
void Stepper<Space>::take_reference() noexcept {
  for (int k = 0; k < saved_count_; ++k) state_[saved_[k]].saved = false;
  saved_count_ = since_reference_ = 0;
  reference_ = chi2_;
}

template <class Space>
void Stepper<Space>::back_to_reference() noexcept {
  for (int k = 0; k < saved_count_; ++k)
    graph_.node(saved_[k]).pose = graph_.node(saved_[k]).backup;
  loss_ = -1.0;  // no model is judged by going back
  if (chi2_ < kLost * reference_) {
    for (int k = 0; k < saved_count_; ++k)
      graph_.for_each_incident(saved_[k], [&](int f, int) { evaluate(f); });
  } else {  // sums that went so far would not come back but for rounding
    evaluate_all();
  }
  loss_ = 0.0;
  take_reference();
}

template <class Space>
auto Stepper<Space>::step(Allowance& allowance, double tolerance) noexcept -> Result {
  if (phase_ == Phase::kIdle) phase_ = Phase::kEvaluate;
  if (phase_ == Phase::kEvaluate) {
    if (!catch_up(allowance)) return Result::kDeadline;
    if (const Result verdict = judge(tolerance); verdict != Result::kDeadline) {
      phase_ = Phase::kIdle;
      return verdict;
    }
    prune_ = 1e-3 * tolerance;
    mark_paths(1e-6 * tolerance / std::max(1, graph_.node_count()));
    sequence_marked();
    cursor_ = sequence_count_;
    predicted_ = 0.0;
    phase_ = Phase::kForward;
  }
  if (phase_ == Phase::kForward) {
    while (cursor_ > 0) {
      if (allowance.spend(kColumnWork * elimination_.pool().length(sequence_[cursor_ - 1])))
        return Result::kDeadline;
      forward_one(sequence_[--cursor_]);
    }
    if (!(predicted_ > tolerance) || !std::isfinite(predicted_)) {
      phase_ = Phase::kIdle;
      return Result::kConverged;
    }
    start_backward();
    phase_ = Phase::kBackward;
  }
  if (phase_ == Phase::kBackward) {
    if (!backward(allowance)) return Result::kDeadline;
    phase_ = Phase::kMove;
    // The move is not divided: in the next call, when this one has no room for it.
    if (!allowance.fits(kFactorWork * std::min(3 * moved_count_, graph_.factor_count())))
      return Result::kDeadline;
  }
  stale_above_ = std::max(1e-2 * tolerance, 1e-4 * predicted_);
  for (int k = 0; k < seed_count_; ++k) state_[seeds_[k]].seed = false;
  seed_count_ = 0;
  aim();
  move();
  (void)allowance.spend(kFactorWork * (moved_count_ + queue_count_));
  phase_ = Phase::kIdle;
  return Result::kMoved;
}

// What to make of the last move, now that its factors are evaluated. kDeadline: go on. A step may
// raise the objective and the next bring it down below: steps across a curved valley do. Only some
// steps in a row without a new low are taken back (a watchdog).
template <class Space>
auto Stepper<Space>::judge(double tolerance) noexcept -> Result {
  const double loss = loss_;
  loss_ = 0.0;
  const bool poor = expected_ > 0.0 && last_chi2_ - chi2_ < 0.5 * expected_ - tolerance;
  // Anew only for a miss that counts: a few steps cost less than all columns.
  const bool misled = poor && last_chi2_ - chi2_ < 0.5 * expected_ - 10.0 * tolerance;
  expected_ = 0.0;
  if (scale_ < kLeastScale) {
    scale_ = 1.0;
    return Result::kStuck;
  }
  if ((misled || misjudges_) && since_refresh_ > 1) {
    if (reference_ >= 0.0 && !(chi2_ <= reference_)) back_to_reference();
    since_refresh_ = 0;
    misjudges_ = false;
    return Result::kMisled;
  }
  careful_ = careful_ || poor;
  if (reference_ < 0.0 || chi2_ <= reference_ + 0.1 * tolerance) {
    take_reference();
    scale_ = std::min(1.0, 2.0 * scale_);
  } else if (++since_reference_ >= kPatience || !(chi2_ < kFar * reference_)) {
    back_to_reference();
    last_power_ = 0.0;
    scale_ *= 0.25;
    if (scale_ > kLeastScale) return Result::kDeadline;
    scale_ = 1.0;
    return Result::kStuck;
  }
  return loss > tolerance && stale_count_ > 0 ? Result::kStale : Result::kDeadline;
}

// The direction: what the triangular solves gave, made conjugate to the last one (Fletcher-Reeves)
// where the factor is stale; then the length, from the exact curvature along it.
template <class Space>
void Stepper<Space>::aim() noexcept {
  double beta = 0.0;
  if (careful_ && last_power_ > 0.0 && predicted_ < last_power_) beta = predicted_ / last_power_;
  last_power_ = predicted_;
  for (int k = 0; k < moved_count_; ++k) {
    State& s = state_[moved_[k]];
    const bool before = beta > 0.0 && s.aimed == last_stamp_;
    s.direction = before ? (s.delta + beta * s.direction).eval() : s.delta;
    s.aimed = stamp_;
  }
  if (beta > 0.0) {
    for (int k = 0; k < earlier_count_; ++k) {
      State& s = state_[earlier_[k]];
      if (s.aimed != last_stamp_) continue;
      s.direction *= beta;
      s.aimed = stamp_;
      moved_[moved_count_++] = earlier_[k];
    }
  }
  last_stamp_ = stamp_;
  for (int k = 0; k < moved_count_; ++k)
    graph_.for_each_incident(moved_[k], [&](int f, int) { queue(f); });
  double length = scale_;
  expected_ = predicted_ * scale_ * (2.0 - scale_);
  if (careful_ || since_refresh_ > 0) {  // a mixture of old and new: its steps may be far too long
    double slope = 0.0;
    for (int k = 0; k < moved_count_; ++k)
      slope += state_[moved_[k]].gradient.dot(state_[moved_[k]].direction);
    const double bend = curvature();
    if (bend > 0.0 && slope > 0.0) {
      length *= slope / bend;
      expected_ = slope * slope / bend * scale_ * (2.0 - scale_);
      misjudges_ = expected_ < 0.3 * predicted_ * scale_ * (2.0 - scale_);
    }
  }
  for (int k = 0; k < moved_count_; ++k) {
    State& s = state_[moved_[k]];
    s.step = s.direction * (graph_.node(moved_[k]).anchor > 0.0 ? 0.0 : length);
  }
}

template <class Space>
void Stepper<Space>::move() noexcept {
  last_chi2_ = chi2_;
  ++since_refresh_;
  for (int k = 0; k < moved_count_; ++k) {
    const int i = moved_[k];
    Node<Space>& n = graph_.node(i);
    if (!state_[i].saved) {
      state_[i].saved = true;
      saved_[saved_count_++] = i;
      n.backup = n.pose;
    }
    n.pose = Space::retract(n.pose, state_[i].step);
  }
}

template <class Space>
double Stepper<Space>::full_step() noexcept {
  forget_step();
  prune_ = 0.0;
  mark_paths(-1.0);
  sequence_marked();
  predicted_ = 0.0;
  for (int k = sequence_count_; k > 0;) forward_one(sequence_[--k]);
  start_backward();
  Allowance unlimited = Allowance::unlimited();
  (void)backward(unlimited);
  scale_ = 1.0;
  aim();
  move();
  return predicted_;
}

template class Stepper<PlanarSpace>;
template class Stepper<SpatialSpace>;

}  // namespace maplet
