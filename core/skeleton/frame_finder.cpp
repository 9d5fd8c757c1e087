// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Which pairs of groups are looked at, and what is made of the answer. frame_finder_fit.cpp fits.
#include "core/skeleton/frame_finder.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/skeleton/linearise.hpp"

namespace maplet {

namespace {

constexpr double kClearly = 14.0;  // chi2 that the runner-up must be worse by
constexpr double kFitsAtMost =
    16.0;                        // chi2 a sight, of the answer: odometry drifts while they wait
constexpr double kLoose = 0.25;  // standard deviation of the answer, by the typical range

/// Scalars that a sight measures.
int rows_of(FactorKind kind, int point) noexcept {
  if (kind == FactorKind::kRange) return 1;
  if (kind == FactorKind::kBearing) return point - 1;
  return point;
}

double range_of(const Factor<PlanarSpace>& f) noexcept {
  return f.kind == FactorKind::kPosition ? std::hypot(f.z.x, f.z.y) : f.z.x;
}
double range_of(const Factor<SpatialSpace>& f) noexcept {
  return f.kind == FactorKind::kPosition ? f.z.t.norm() : f.z.q.w();
}

}  // namespace

template <class Space>
FrameFinder<Space>::FrameFinder(PoseGraph<Space>& graph, Arena& arena)
    : graph_{graph},
      waiting_{arena.make_array<int>(graph.graph().max_factors(), "skeleton/sights")},
      tried_{arena.make_array<int>(graph.graph().max_nodes(), "skeleton/sights")} {}

template <class Space>
void FrameFinder<Space>::note(int factor) noexcept {
  const Factor<Space>& f = graph_.graph().factor(factor);
  if (graph_.group(f.a) == graph_.group(f.b)) return;
  waiting_[waiting_count_++] = factor;
  idle_ = false;
}

template <class Space>
void FrameFinder<Space>::forget(int factor) noexcept {
  const auto end = waiting_.begin() + waiting_count_;
  waiting_count_ = static_cast<int>(std::remove(waiting_.begin(), end, factor) - waiting_.begin());
  const auto used = samples_.begin() + sample_count_;
  if (busy_ && std::find(samples_.begin(), used, factor) != used) busy_ = false;
}

// What other things have joined meanwhile begins to count.
template <class Space>
void FrameFinder<Space>::sweep() noexcept {
  int kept = 0;
  for (int k = 0; k < waiting_count_; ++k) {
    const int factor = waiting_[k];
    const Factor<Space>& f = graph_.graph().factor(factor);
    if (f.a == -1) continue;  // removed
    if (graph_.group(f.a) == graph_.group(f.b)) {
      graph_.set_weight(factor, f.weight);
    } else {
      waiting_[kept++] = factor;
    }
  }
  waiting_count_ = kept;
}

template <class Space>
bool FrameFinder<Space>::begin_pair() noexcept {
  const auto& nodes = graph_.graph();
  for (int looked = 0; looked < waiting_count_; ++looked) {
    cursor_ = cursor_ + 1 < waiting_count_ ? cursor_ + 1 : 0;
    const Factor<Space>& first = nodes.factor(waiting_[cursor_]);
    group_a_ = graph_.group(first.a);
    group_b_ = graph_.group(first.b);
    if (nodes.node(group_b_).seniority < nodes.node(group_a_).seniority)
      std::swap(group_a_, group_b_);
    int rows = 0;
    pair_count_ = 0;
    for (int k = 0; k < waiting_count_; ++k) {
      const Factor<Space>& f = nodes.factor(waiting_[k]);
      const int a = graph_.group(f.a);
      const int b = graph_.group(f.b);
      if ((a != group_a_ || b != group_b_) && (a != group_b_ || b != group_a_)) continue;
      ++pair_count_;
      rows += rows_of(f.kind, Space::kPoint);
    }
    point_ = nodes.node(group_b_).point;
    const int unknowns = point_ ? Space::kPoint : Space::kDim;
    if (rows < unknowns + 2 || pair_count_ < tried_[group_b_] + tried_[group_b_] / 4 + 1) continue;
    tried_[group_b_] = pair_count_;
    gather();
    return true;
  }
  return false;
}

// A spread of the pair's sights; those that the coarse fit uses come first.
template <class Space>
void FrameFinder<Space>::gather() noexcept {
  const auto& nodes = graph_.graph();
  const int wanted = std::min(pair_count_, kSamples);
  int seen = 0;
  int taken = 0;
  centre_a_.setZero();
  centre_b_.setZero();
  range_ = 0.0;
  for (int k = 0; k < waiting_count_ && taken < wanted; ++k) {
    const Factor<Space>& f = nodes.factor(waiting_[k]);
    const int a = graph_.group(f.a);
    const int b = graph_.group(f.b);
    if ((a != group_a_ || b != group_b_) && (a != group_b_ || b != group_a_)) continue;
    if (static_cast<std::int64_t>(seen++) * wanted < static_cast<std::int64_t>(taken) * pair_count_)
      continue;
    samples_[taken++] = waiting_[k];
    const bool turned = a != group_a_;
    centre_a_ += measure::position(nodes.node(turned ? f.b : f.a).pose);
    centre_b_ += measure::position(nodes.node(turned ? f.a : f.b).pose);
    range_ += range_of(f);
  }
  sample_count_ = taken;
  centre_a_ /= taken;
  centre_b_ /= taken;
  range_ = std::max(range_ / taken, 1e-3);
  const int coarse = std::min(taken, kCoarseSamples);
  for (int k = 1; k < coarse; ++k) std::swap(samples_[k], samples_[k * taken / coarse]);
  next_start_ = 0;
  kept_.clear();
  busy_ = true;
}

template <class Space>
void FrameFinder<Space>::keep(const Candidate& candidate) noexcept {
  for (Candidate& c : kept_) {
    if (!same(c.T, candidate.T)) continue;
    if (candidate.cost < c.cost) c = candidate;
    return;
  }
  kept_.push_back(candidate);
  std::sort(kept_.begin(), kept_.end(),
            [](const Candidate& x, const Candidate& y) { return x.cost < y.cost; });
  if (kept_.size() > kKept) kept_.pop_back();
}

// Joins the groups where one relation stands out.
template <class Space>
bool FrameFinder<Space>::decide() noexcept {
  StaticVector<Candidate, kKept + 1> coarse{kept_.begin(), kept_.end()};
  kept_.clear();
  for (Candidate& c : coarse) {
    c.cost = fit(c.T, sample_count_, 40);
    keep(c);
  }
  Candidate& best = kept_.front();
  Block h;
  best.cost = fit(best.T, sample_count_, 10, &h);
  int rows = 0;
  for (int k = 0; k < sample_count_; ++k)
    rows += rows_of(graph_.graph().factor(samples_[k]).kind, Space::kPoint);
  const int unknowns = point_ ? Space::kPoint : Space::kDim;
  const double scale = std::max(1.0, best.cost / std::max(1, rows - unknowns));
  if (scale > kFitsAtMost) return false;
  if (kept_.size() > 1 && kept_[1].cost - best.cost < kClearly * scale) {
    ++ambiguous_;
    return false;
  }
  const Eigen::MatrixXd::Index corner = unknowns;
  Block used = Block::Identity();
  used.topLeftCorner(corner, corner) = h.topLeftCorner(corner, corner);
  const double least =
      Eigen::SelfAdjointEigenSolver<Block>{used, Eigen::EigenvaluesOnly}.eigenvalues().minCoeff();
  if (!(least * kLoose * kLoose * range_ * range_ > scale)) return false;
  // T joins the frames; connect wants it between two nodes.
  const auto& nodes = graph_.graph();
  graph_.connect(
      group_a_, group_b_,
      Space::between(nodes.node(group_a_).pose, Space::compose(best.T, nodes.node(group_b_).pose)));
  ++joined_;
  sweep();
  return true;
}

template <class Space>
bool FrameFinder<Space>::work(Deadline deadline) noexcept {
  if (waiting_count_ == 0) {
    idle_ = true;
    return false;
  }
  if (!busy_) {
    sweep();
    if (!begin_pair()) {
      idle_ = true;
      return false;
    }
  }
  const auto stands = [&](int gauge) { return graph_.group(gauge) == gauge; };
  if (!stands(group_a_) || !stands(group_b_)) {  // joined by something else meanwhile
    busy_ = false;
    return false;
  }
  const int coarse = std::min(sample_count_, kCoarseSamples);
  while (next_start_ < start_count()) {
    if (deadline.expired()) return false;
    Candidate c{start(next_start_++), 0.0};
    c.cost = fit(c.T, coarse, 12);
    keep(c);
  }
  busy_ = false;
  return decide();
}

template class FrameFinder<PlanarSpace>;
template class FrameFinder<SpatialSpace>;

}  // namespace maplet
