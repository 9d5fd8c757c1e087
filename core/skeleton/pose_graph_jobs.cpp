// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Eliminations: what goes into one, what follows from it, what is done when it does not fit.
#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "core/skeleton/forwarding.hpp"
#include "core/skeleton/pose_graph.hpp"

namespace maplet {

// Everything anew, in one job: all factors linearised where they stand, no rounding carried over.
template <class Space>
void PoseGraph<Space>::start_fresh_job(double damping, Model model) noexcept {
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
  elimination_.touch_all(damping, model);
  if (newest_ != kNone && !by_seniority_) elimination_.keep_last(newest_);
  elimination_.begin();
}

template <class Space>
void PoseGraph<Space>::order_by_seniority(bool on) noexcept {
  by_seniority_ = on;
  elimination_.order_by_seniority(on);
  if (!on) return;
  if (elimination_.busy()) elimination_.abandon();
  for (int k = 0; k < job_count_; ++k) graph_.factor(job_[k]).state.in_job = false;
  job_count_ = 0;
  drop_columns();
  stepper_.take_stale([](int) {});
  stepper_.forget_step();
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
  if (newest_ != kNone && graph_.node(newest_).first_incidence != kNone && !by_seniority_) {
    elimination_.touch(newest_);
    elimination_.keep_last(newest_);
  }
  elimination_.begin();
}

// Before everything is eliminated anew in one go: the old columns would only take up room.
template <class Space>
void PoseGraph<Space>::drop_columns() noexcept {
  elimination_.clear();
  for (int i = 0; i < graph_.factor_end(); ++i) {
    FactorState& s = graph_.factor(i).state;
    s.integrated = s.evaluated = false;
  }
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
    drop_columns();
  } else {
    set_factors_aside();
  }
}

// An eighth of what can be spared, drawn by the nodes' seniority alone. What holds the groups
// together stays, odometry before closures; sights, few of which fix nothing, go after all others.
template <class Space>
void PoseGraph<Space>::set_factors_aside() noexcept {
  int spare = gather_spare_links();
  if (spare == 0) {
    for (int i = graph_.factor_end() - 1; i >= 0; --i)
      if (graph_.factor(i).state.active && measure::is_sight(graph_.factor(i).kind))
        job_[spare++] = i;
  }
  for (int k = 0; k < (spare + 7) / 8; ++k) {
    graph_.factor(job_[k]).state.active = false;
    graph_.factor(job_[k]).state.aside = true;
    stepper_.withdraw(job_[k]);
    ++overflows_;
  }
}

template <class Space>
void PoseGraph<Space>::recall_set_aside() noexcept {
  for (int i = 0; i < graph_.factor_end(); ++i)
    if (graph_.factor(i).state.aside) link_in(i);
}

// Into job_: the relative poses without which everything would still hang together, in the order of
// a draw. @return how many
template <class Space>
int PoseGraph<Space>::gather_spare_links() noexcept {
  const auto names = [&](int factor) {
    const Seniority& a = graph_.node(graph_.factor(factor).a).seniority;
    const Seniority& b = graph_.node(graph_.factor(factor).b).seniority;
    return std::minmax(a, b);
  };
  const auto draw = [&](int factor) {
    const auto [a, b] = names(factor);
    return hash_of(hash_of(hash_of(a.high + 1) ^ a.low) ^ hash_of(hash_of(b.high + 2) ^ b.low));
  };
  const auto nearness = [&](int factor) {
    const auto [a, b] = names(factor);
    return std::tuple{a.high != b.high, b.low > a.low ? b.low - a.low : a.low - b.low, draw(factor),
                      factor};
  };
  int count = 0;
  for (int i = 0; i < graph_.factor_end(); ++i)
    if (graph_.factor(i).state.active && graph_.factor(i).kind == FactorKind::kBetween)
      job_[count++] = i;
  std::sort(job_.begin(), job_.begin() + count,
            [&](int x, int y) { return nearness(x) < nearness(y); });
  for (int i = 0; i < graph_.node_end(); ++i) stack_[i] = i;
  const auto part = [&](int node) {
    while (stack_[node] != node) node = stack_[node] = stack_[stack_[node]];
    return node;
  };
  int spare = 0;
  for (int k = 0; k < count; ++k) {
    const Factor<Space>& f = graph_.factor(job_[k]);
    const int a = part(f.a);
    const int b = part(f.b);
    if (a == b) job_[spare++] = job_[k];
    stack_[a] = b;
  }
  std::sort(job_.begin(), job_.begin() + spare, [&](int x, int y) {
    return std::tuple{draw(x), x} < std::tuple{draw(y), y};
  });
  return spare;
}

template <class Space>
void PoseGraph<Space>::finish_job() noexcept {
  double change = 0.0;
  for (int k = 0; k < job_count_; ++k) {
    FactorState& s = graph_.factor(job_[k]).state;
    s.in_job = false;
    if (!s.evaluated) change += std::abs(stepper_.evaluate_new(job_[k]));
  }
  job_count_ = 0;
  if (change > 1e-9 || fresh_job_) wants_step_ = true;
  if (fresh_job_) {
    stepper_.trust_factor();
    stepper_.take_stale([](int) {});  // linearised where the estimate stands, all of them
  }
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

#define MAPLET_INSTANTIATE(Space)                                          \
  template void PoseGraph<Space>::start_fresh_job(double, Model) noexcept; \
  template void PoseGraph<Space>::begin_job() noexcept;                    \
  template void PoseGraph<Space>::start_job() noexcept;                    \
  template void PoseGraph<Space>::drop_columns() noexcept;                 \
  template void PoseGraph<Space>::overcome_overflow() noexcept;            \
  template void PoseGraph<Space>::order_by_seniority(bool) noexcept;       \
  template void PoseGraph<Space>::set_factors_aside() noexcept;            \
  template void PoseGraph<Space>::recall_set_aside() noexcept;             \
  template int PoseGraph<Space>::gather_spare_links() noexcept;            \
  template void PoseGraph<Space>::finish_job() noexcept;
MAPLET_INSTANTIATE(PlanarSpace)
MAPLET_INSTANTIATE(SpatialSpace)
#undef MAPLET_INSTANTIATE

}  // namespace maplet
