// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The steps on an eliminated graph: exact gradient, two triangular solves, a guarded move.
#include <algorithm>
#include <cmath>

#include "core/skeleton/block_kernels.hpp"
#include "core/skeleton/linearise.hpp"
#include "core/skeleton/pose_graph.hpp"

namespace maplet {

namespace {

// information * e from the packed lower triangle.
template <class Space>
typename Space::Tangent weigh(const Factor<Space>& f, const typename Space::Tangent& e) noexcept {
  typename Space::Tangent out = Space::Tangent::Zero();
  int k = 0;
  for (int r = 0; r < Space::kDim; ++r) {
    for (int c = 0; c < r; ++c, ++k) {
      out[r] += f.information[k] * e[c];
      out[c] += f.information[k] * e[r];
    }
    out[r] += f.information[k++] * e[r];
  }
  return out;
}

}  // namespace

// Errors and the gradient, exactly, at the present estimate (eq. 7).
template <class Space>
double PoseGraph<Space>::evaluate() noexcept {
  for (int i = 0; i < graph_.node_end(); ++i) gradient_[i].setZero();
  double sum = 0.0;
  for (int i = 0; i < graph_.factor_end(); ++i) {
    Factor<Space>& f = graph_.factor(i);
    if (!f.state.active) continue;
    const Pose rel = relative_pose(graph_, f);
    f.e = Space::error(f.z, rel);
    const Tangent v = weigh<Space>(f, f.e);
    f.chi2 = f.e.dot(v);
    sum += f.weight * f.chi2;
    Tangent by_a, by_b;
    Space::pull_back(f.z, rel, f.e, v, by_a, by_b);
    if (f.kind == FactorKind::kPrior) {
      gradient_[f.a] -= f.weight * by_b;
      continue;
    }
    gradient_[f.a] -= f.weight * by_a;
    gradient_[f.b] -= f.weight * by_b;
  }
  return chi2_ = sum;
}

template <class Space>
void PoseGraph<Space>::sequence_nodes() noexcept {
  sequence_count_ = 0;
  for (int root = elimination_.first_root(); root != kNone;
       root = elimination_.next_sibling(root)) {
    for (int n = root;;) {
      sequence_[sequence_count_++] = n;
      if (elimination_.first_child(n) != kNone) {
        n = elimination_.first_child(n);
        continue;
      }
      while (n != root && elimination_.next_sibling(n) == kNone) n = elimination_.parent(n);
      if (n == root) break;
      n = elimination_.next_sibling(n);
    }
  }
  sequence_stale_ = false;
}

// delta = H^-1 gradient with the factor at hand. @return gradient^T H^-1 gradient, eq. 11
template <class Space>
double PoseGraph<Space>::solve() noexcept {
  constexpr int kDim = Space::kDim;
  const ColumnPool<kDim>& pool = elimination_.pool();
  if (sequence_stale_) sequence_nodes();
  for (int k = 0; k < sequence_count_; ++k) delta_[sequence_[k]] = gradient_[sequence_[k]];
  double gain = 0.0;
  for (int k = sequence_count_ - 1; k >= 0; --k) {
    const int n = sequence_[k];
    const int start = pool.start(n);
    block::solve_lower<kDim>(pool.block(start), delta_[n].data());
    gain += delta_[n].squaredNorm();
    for (int s = start + 1; s < start + pool.length(n); ++s)
      block::subtract_times<kDim>(delta_[pool.slot(s).row].data(), pool.block(s), delta_[n].data());
  }
  for (int k = 0; k < sequence_count_; ++k) {
    const int n = sequence_[k];
    const int start = pool.start(n);
    for (int s = start + 1; s < start + pool.length(n); ++s)
      block::subtract_transposed_times<kDim>(delta_[n].data(), pool.block(s),
                                             delta_[pool.slot(s).row].data());
    block::solve_lower_transposed<kDim>(pool.block(start), delta_[n].data());
  }
  return gain;
}

template <class Space>
void PoseGraph<Space>::move(double scale) noexcept {
  for (int k = 0; k < sequence_count_; ++k) {
    Node<Space>& n = graph_.node(sequence_[k]);
    n.backup = n.pose;
    if (n.anchor > 0.0) continue;
    n.pose = Space::retract(n.pose, scale * delta_[sequence_[k]]);
  }
}

template <class Space>
void PoseGraph<Space>::restore() noexcept {
  for (int k = 0; k < sequence_count_; ++k) {
    Node<Space>& n = graph_.node(sequence_[k]);
    n.pose = n.backup;
  }
}

template <class Space>
auto PoseGraph<Space>::step() noexcept -> StepResult {
  const double before = best_chi2_;
  const double now = evaluate();
  const bool worse = before >= 0.0 && !(now <= before * (1.0 + 1e-12) + 1e-12);
  if (worse) {
    // The step went too far, or in a stale direction.
    restore();
    chi2_ = best_chi2_;
    if (relinearise_stale(0.01) > 0) {
      scale_ = 1.0;
      best_chi2_ = -1.0;
      return StepResult::kMoved;
    }
    scale_ *= 0.25;
    if (scale_ < 1e-4) {
      scale_ = 1.0;
      best_chi2_ = -1.0;
      return StepResult::kStuck;
    }
    move(scale_);
    return StepResult::kMoved;
  }
  if (before >= 0.0 && before - now < 0.5 * predicted_ * scale_ && relinearise_stale(0.01) > 0) {
    scale_ = 1.0;
    best_chi2_ = -1.0;
    return StepResult::kMoved;
  }
  scale_ = std::min(1.0, 2.0 * scale_);
  const double gain = solve();
  predicted_ = gain;
  if (!(gain > 1e-6 * now + 1e-9)) {
    best_chi2_ = -1.0;
    return StepResult::kConverged;
  }
  best_chi2_ = now;
  move(scale_);
  return StepResult::kMoved;
}

template <class Space>
int PoseGraph<Space>::relinearise_stale(double threshold) noexcept {
  int count = 0;
  for (int i = 0; i < graph_.factor_end(); ++i) {
    Factor<Space>& f = graph_.factor(i);
    if (!f.state.active || !f.state.integrated) continue;
    if (Space::staleness(relative_pose(graph_, f), f.rel_lin) <= threshold) continue;
    mark_dirty(i);
    ++count;
  }
  return count;
}

template <class Space>
SolveReport PoseGraph<Space>::optimise(Deadline deadline, int max_iterations) noexcept {
  SolveReport report;
  double damping = 0.0;
  double now = evaluate();
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
    const double gain = solve();
    move(1.0);
    const double next = evaluate();
    if (next <= now * (1.0 + 1e-12) + 1e-12) {
      const double gained = now - next;
      now = next;
      damping = damping < 1e-7 ? 0.0 : 0.1 * damping;
      if (gain <= 1e-9 * now + 1e-12 && gained <= 1e-9 * now + 1e-12) {
        report.stop = Stop::kConverged;
        break;
      }
    } else {
      restore();
      now = evaluate();
      if (gain <= 1e-9 * now) {
        report.stop = Stop::kConverged;
        break;
      }
      damping = std::max(10.0 * damping, 1e-6);
      if (damping > 1e8) break;
    }
  }
  unsettled_ = false;
  best_chi2_ = -1.0;
  report.chi2 = chi2_ = now;
  return report;
}

#define MAPLET_INSTANTIATE(Space)                                    \
  template double PoseGraph<Space>::evaluate() noexcept;             \
  template void PoseGraph<Space>::sequence_nodes() noexcept;         \
  template double PoseGraph<Space>::solve() noexcept;                \
  template void PoseGraph<Space>::move(double) noexcept;             \
  template void PoseGraph<Space>::restore() noexcept;                \
  template auto PoseGraph<Space>::step() noexcept->StepResult;       \
  template int PoseGraph<Space>::relinearise_stale(double) noexcept; \
  template SolveReport PoseGraph<Space>::optimise(Deadline, int) noexcept;
MAPLET_INSTANTIATE(PlanarSpace)
MAPLET_INSTANTIATE(SpatialSpace)
#undef MAPLET_INSTANTIATE

}  // namespace maplet
