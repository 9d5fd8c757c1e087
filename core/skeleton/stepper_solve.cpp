// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The parts of a step: factors' errors and gradients, the triangular solves on parts of the tree.
#include <algorithm>
#include <cmath>

#include "core/skeleton/block_kernels.hpp"
#include "core/skeleton/linearise.hpp"
#include "core/skeleton/stepper.hpp"

namespace maplet {

template <class Space>
void Stepper<Space>::add_gradient(int node, const Tangent& change) noexcept {
  State& s = state_[node];
  s.gradient += change;
  if (s.seed) return;
  s.seed = true;
  seeds_[seed_count_++] = node;
}

// Error and gradient at the present estimate, exactly (eq. 7).
template <class Space>
double Stepper<Space>::evaluate(int factor) noexcept {
  Factor<Space>& f = graph_.factor(factor);
  if (!f.state.active || !f.state.integrated) return 0.0;
  const auto rel = relative_pose(graph_, f);
  const Tangent before = f.e;
  f.e = measure::error(f, rel);
  const Tangent v = weigh(f, f.e);
  const double old = f.counted;
  f.chi2 = f.e.dot(v);
  f.counted = f.weight * f.chi2;
  chi2_ += f.counted - old;
  Tangent by_a, by_b;
  measure::pull_back(f, rel, f.e, (-f.weight * v).eval(), by_a, by_b);
  if (f.kind == FactorKind::kPrior) by_a = by_b;
  add_gradient(f.a, by_a - f.gradient_a);
  f.gradient_a = by_a;
  if (f.b != kNone) {
    add_gradient(f.b, by_b - f.gradient_b);
    f.gradient_b = by_b;
  }
  f.state.evaluated = true;
  note_staleness(factor, rel, before);
  return f.counted - old;
}

template <class Space>
void Stepper<Space>::withdraw(int factor) noexcept {
  Factor<Space>& f = graph_.factor(factor);
  chi2_ -= f.counted;
  f.counted = 0.0;
  f.state.evaluated = false;
  add_gradient(f.a, -f.gradient_a);
  f.gradient_a.setZero();
  if (f.b == kNone) return;
  add_gradient(f.b, -f.gradient_b);
  f.gradient_b.setZero();
}

template <class Space>
void Stepper<Space>::evaluate_all() noexcept {
  chi2_ = 0.0;
  for (int i = 0; i < graph_.node_end(); ++i) state_[i].gradient.setZero();
  for (int i = 0; i < graph_.factor_end(); ++i) {
    Factor<Space>& f = graph_.factor(i);
    f.gradient_a.setZero();
    f.gradient_b.setZero();
    f.counted = 0.0;
    f.state.queued = false;
    evaluate(i);
  }
  queue_count_ = 0;
}

// What the factor's linear model missed in the last step, whitened (eq. 12): the gain of
// linearising it anew.
template <class Space>
void Stepper<Space>::note_staleness(int factor, const typename Space::Pose& rel,
                                    const Tangent& before) noexcept {
  Factor<Space>& f = graph_.factor(factor);
  if (loss_ < 0.0 || f.kind == FactorKind::kPrior) return;
  const Tangent change = f.e - before;
  const double stale = Space::staleness(rel, f.rel_lin);
  // Cheap and generous first: most factors move rigidly.
  if (stale * stale * f.weight * f.stiffness * change.squaredNorm() < stale_above_) return;
  typename Space::Block by_a, by_b;
  measure::jacobians(f, f.rel_lin, measure::error(f, f.rel_lin), by_a, by_b);
  Tangent missed = change;
  if (state_[f.a].aimed == stamp_) missed -= by_a * state_[f.a].step;
  if (state_[f.b].aimed == stamp_) missed -= by_b * state_[f.b].step;
  const double loss = f.weight * missed.dot(weigh(f, missed));
  loss_ += loss;
  if (loss < stale_above_ || f.state.stale) return;
  f.state.stale = true;
  stale_[stale_count_++] = factor;
}

// Marks the paths of all nodes whose own gradient promises more than the threshold.
template <class Space>
void Stepper<Space>::mark_paths(double threshold) noexcept {
  ++stamp_;
  root_count_ = 0;
  const auto mark = [&](int node) {
    while (state_[node].marked != stamp_) {
      state_[node].marked = stamp_;
      state_[node].delta = state_[node].gradient;
      const int parent = elimination_.parent(node);
      if (parent == kNone) {
        roots_[root_count_++] = node;
        return;
      }
      node = parent;
    }
  };
  if (threshold < 0.0) {
    for (int i = 0; i < graph_.node_end(); ++i)
      if (graph_.node(i).used && elimination_.contains(i)) mark(i);
    return;
  }
  const ColumnPool<kDim>& pool = elimination_.pool();
  int kept = 0;
  for (int k = 0; k < seed_count_; ++k) {
    const int n = seeds_[k];
    if (!elimination_.contains(n) || state_[n].marked == stamp_) {
      seeds_[kept++] = n;
      continue;
    }
    Tangent y = state_[n].gradient;
    const double* pivot = pool.block(pool.start(n));
    // |C^-1 g|^2 > |g|^2 / |C|^2: mostly that is enough.
    bool counts =
        y.squaredNorm() > threshold * Eigen::Map<const typename Space::Block>{pivot}.squaredNorm();
    if (!counts) {
      block::solve_lower<kDim>(pivot, y.data());
      counts = y.squaredNorm() > threshold;
    }
    if (counts) {
      seeds_[kept++] = n;
      mark(n);
    } else {
      state_[n].seed = false;
    }
  }
  seed_count_ = kept;
}

template <class Space>
void Stepper<Space>::sequence_marked() noexcept {
  sequence_count_ = 0;
  const auto first_marked = [&](int n) {
    while (n != kNone && state_[n].marked != stamp_) n = elimination_.next_sibling(n);
    return n;
  };
  for (int r = 0; r < root_count_; ++r) {
    const int root = roots_[r];
    for (int n = root; n != kNone;) {
      sequence_[sequence_count_++] = n;
      int next = first_marked(elimination_.first_child(n));
      while (next == kNone && n != root) {
        next = first_marked(elimination_.next_sibling(n));
        if (next == kNone) n = elimination_.parent(n);
      }
      n = next;
    }
  }
}

template <class Space>
void Stepper<Space>::forward_one(int node) noexcept {
  const ColumnPool<kDim>& pool = elimination_.pool();
  const int start = pool.start(node);
  const int end = start + pool.length(node);
  Tangent& d = state_[node].delta;
  block::solve_lower<kDim>(pool.block(start), d.data());
  predicted_ += d.squaredNorm();
  for (int s = start + 1; s < end; ++s)
    block::subtract_times<kDim>(state_[pool.slot(s).row].delta.data(), pool.block(s), d.data());
}

template <class Space>
bool Stepper<Space>::backward_one(int node, double threshold) noexcept {
  const ColumnPool<kDim>& pool = elimination_.pool();
  const int start = pool.start(node);
  const int end = start + pool.length(node);
  State& state = state_[node];
  bool any = state.marked == stamp_;
  if (!any) state.delta.setZero();
  for (int s = start + 1; s < end; ++s) {
    const State& row = state_[pool.slot(s).row];
    if (row.moved != stamp_) continue;
    any = true;
    block::subtract_transposed_times<kDim>(state.delta.data(), pool.block(s), row.delta.data());
  }
  if (!any) return false;
  // delta = C^-T d, and d^T d is what leaving it out would cost.
  const bool moves = state.delta.squaredNorm() > threshold || threshold == 0.0;
  if (moves) {
    block::solve_lower_transposed<kDim>(pool.block(start), state.delta.data());
    state.moved = stamp_;
    moved_[moved_count_++] = node;
  }
  return true;
}

template <class Space>
void Stepper<Space>::start_backward() noexcept {
  std::swap(moved_, earlier_);
  earlier_count_ = moved_count_;
  moved_count_ = root_cursor_ = 0;
  walk_ = kNone;
}

// direction^T H direction with every factor linearised where the estimate stands (the queue holds
// those that the direction reaches).
template <class Space>
double Stepper<Space>::curvature() noexcept {
  double sum = 0.0;
  const Tangent zero = Tangent::Zero();
  for (int k = 0; k < queue_count_; ++k) {
    const Factor<Space>& f = graph_.factor(queue_[k]);
    const auto along = [&](int node) -> const Tangent& {
      return node != kNone && state_[node].aimed == stamp_ ? state_[node].direction : zero;
    };
    const Tangent& a = along(f.a);
    const Tangent change =
        f.kind == FactorKind::kPrior
            ? measure::push_forward(f, relative_pose(graph_, f), f.e, zero, a)
            : measure::push_forward(f, relative_pose(graph_, f), f.e, a, along(f.b));
    sum += f.weight * change.dot(weigh(f, change));
  }
  return sum;
}

// Down the trees of the marked roots, leaving out what the step does not reach.
template <class Space>
bool Stepper<Space>::backward(Allowance& allowance) noexcept {
  while (root_cursor_ < root_count_) {
    const int root = roots_[root_cursor_];
    if (walk_ == kNone) walk_ = root;
    while (walk_ != kNone) {
      if (allowance.spend(kColumnWork * elimination_.pool().length(walk_))) return false;
      int next = backward_one(walk_, prune_) ? elimination_.first_child(walk_) : kNone;
      while (next == kNone && walk_ != root) {
        next = elimination_.next_sibling(walk_);
        if (next == kNone) walk_ = elimination_.parent(walk_);
      }
      walk_ = next;
    }
    ++root_cursor_;
  }
  return true;
}

#define MAPLET_INSTANTIATE(Space)                                                  \
  template double Stepper<Space>::evaluate(int) noexcept;                          \
  template void Stepper<Space>::add_gradient(int, const Space::Tangent&) noexcept; \
  template void Stepper<Space>::withdraw(int) noexcept;                            \
  template void Stepper<Space>::evaluate_all() noexcept;                           \
  template void Stepper<Space>::note_staleness(int, const Space::Pose&,            \
                                               const Space::Tangent&) noexcept;    \
  template void Stepper<Space>::mark_paths(double) noexcept;                       \
  template void Stepper<Space>::sequence_marked() noexcept;                        \
  template void Stepper<Space>::forward_one(int) noexcept;                         \
  template bool Stepper<Space>::backward_one(int, double) noexcept;                \
  template void Stepper<Space>::start_backward() noexcept;                         \
  template double Stepper<Space>::curvature() noexcept;                            \
  template bool Stepper<Space>::backward(Allowance&) noexcept;
MAPLET_INSTANTIATE(PlanarSpace)
MAPLET_INSTANTIATE(SpatialSpace)
#undef MAPLET_INSTANTIATE

}  // namespace maplet
