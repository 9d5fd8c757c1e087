// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The engine's work: eliminations and steps in turn, until the deadline. pose_graph_jobs.cpp has
// the eliminations.
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/skeleton/linearise.hpp"
#include "core/skeleton/pose_graph.hpp"

namespace maplet {

template <class Space>
double PoseGraph<Space>::tolerance(bool idle) const noexcept {
  return idle ? 1e-8 * stepper_.chi2() + 1e-10
              : std::max(policy_.step_share * stepper_.chi2(), policy_.step_gain);
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

// Steps where they converge; what they find stale again and again is not waited for.
template <class Space>
bool PoseGraph<Space>::flush(Deadline deadline) noexcept {
  int steps = 50;
  flushing_ = true;
  const auto waits = [&] { return dirty_count_ > 0 || elimination_.busy(); };
  for (int k = 0; k < 1000 && waits() && (k == 0 || !deadline.expired()); ++k) {
    job_first_ = true;
    new_input_ = true;
    steps -= update(deadline, stepper_.busy() ? std::max(steps, 1) : steps).iterations;
    steps = std::max(steps, 0);
  }
  flushing_ = false;
  return !waits();
}

template <class Space>
SolveReport PoseGraph<Space>::update(Deadline deadline, int max_iterations) noexcept {
  using Step = typename Stepper<Space>::Result;
  const bool idle = !new_input_;
  const std::int64_t work = policy_.work_per_update;
  Allowance allowance{deadline, idle ? work + work / 2 : work};
  SolveReport report;
  // Where a step has just been made and not been looked at, nothing is to be fitted.
  if (new_input_ && !stepper_.unverified() && !elimination_.contains(newest_)) relax(newest_);
  new_input_ = false;
  if (idle && !settled_) wants_step_ = true;
  for (bool first = true;; first = false) {
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
      // The start of a job of everything is not divided: in the next call, when this one has no
      // room for it.
      const int start = refresh_ ? Stepper<Space>::kFactorWork * graph_.factor_count() : 0;
      if (!stepper_.catch_up(allowance) || (!first && start > 0 && !allowance.fits(start))) {
        report.stop = Stop::kDeadline;
        break;
      }
      job_first_ = false;
      if (std::exchange(refresh_, false)) {
        stepper_.come_back();
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
      wants_step_ = true;
    } else if (result == Step::kStale) {
      stepper_.take_stale([&](int f) { mark_dirty(f); });
      pending_ = std::max(pending_, policy_.defer_share * stepper_.chi2());
      job_first_ = true;
    } else if (result == Step::kMisled) {
      refresh_ = job_first_ = true;
    } else {
      wants_step_ = false;
      settled_ = settled_ || idle;
    }
  }
  if (dirty_count_ > 0) settled_ = false;
  report.chi2 = stepper_.chi2();
  return report;
}

template <class Space>
bool PoseGraph<Space>::polish(double step, int max_iterations) noexcept {
  for (int k = 0; k < max_iterations; ++k) {
    if (elimination_.busy()) elimination_.abandon();
    for (int i = 0; i < job_count_; ++i) graph_.factor(job_[i]).state.in_job = false;
    drop_columns();
    start_fresh_job(0.0);
    Allowance unlimited = Allowance::unlimited();
    if (elimination_.run(unlimited) != Elimination<Space>::Result::kCommitted) {
      overcome_overflow();
      return false;
    }
    finish_job();
    (void)chi2();
    (void)stepper_.full_step();
    (void)chi2();
    stepper_.forget_step();
    if (stepper_.largest_step() < step) {
      wants_step_ = false;
      settled_ = true;
      return true;
    }
  }
  return false;
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
    drop_columns();
    start_fresh_job(damping);
    Allowance unlimited = Allowance::unlimited();
    if (elimination_.run(unlimited) != Elimination<Space>::Result::kCommitted) {
      overcome_overflow();
      continue;
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
  wants_step_ = refresh_ = job_first_ = false;
  settled_ = true;
  stepper_.forget_step();
  report.chi2 = now;
  return report;
}

#define MAPLET_INSTANTIATE(Space)                                        \
  template double PoseGraph<Space>::tolerance(bool) const noexcept;      \
  template bool PoseGraph<Space>::any_stale() const noexcept;            \
  template bool PoseGraph<Space>::due(bool) const noexcept;              \
  template bool PoseGraph<Space>::flush(Deadline) noexcept;              \
  template SolveReport PoseGraph<Space>::update(Deadline, int) noexcept; \
  template bool PoseGraph<Space>::polish(double, int) noexcept;          \
  template SolveReport PoseGraph<Space>::optimise(Deadline, int) noexcept;
MAPLET_INSTANTIATE(PlanarSpace)
MAPLET_INSTANTIATE(SpatialSpace)
#undef MAPLET_INSTANTIATE

}  // namespace maplet
