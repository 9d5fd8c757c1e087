// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/closure_judge.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/skeleton/linearise.hpp"

namespace maplet {

namespace {

double translation_extent(const Se2 &a, const Se2 &b) noexcept {
  return std::hypot(a.x - b.x, a.y - b.y);
}
double translation_extent(const Se3 &a, const Se3 &b) noexcept { return (a.t - b.t).norm(); }

}  // namespace

template <class Space>
ClosureJudge<Space>::ClosureJudge(PoseGraph<Space> &graph, Arena &arena, const JudgePolicy &policy,
                                  const OdometryChains<Space> *chains)
    : graph_{graph},
      policy_{policy},
      gate_{kGate * policy.inflation * policy.inflation},
      marginals_{graph.graph(), graph.elimination(), arena},
      chains_{chains},
      state_{arena.make_array<ClosureState>(graph.graph().max_factors(), "skeleton/closures")},
      chance_{arena.make_array<float>(graph.graph().max_factors(), "skeleton/closures")},
      beyond_{arena.make_array<float>(graph.graph().max_factors(), "skeleton/closures")},
      closures_{arena.make_array<int>(graph.graph().max_factors(), "skeleton/closures")} {}

template <class Space>
bool ClosureJudge<Space>::measure(int factor, int slot, Innovation &out) noexcept {
  const Factor<Space> &f = graph_.graph().factor(factor);
  if (!marginals_.known(f.a, f.b) || graph_.group(f.a) != graph_.group(f.b)) return false;
  const auto rel = relative_pose(graph_.graph(), f);
  Block by_a, by_b;
  out.e = Space::error(f.z, rel);
  Space::jacobians(f.z, rel, out.e, by_a, by_b);
  out.covariance = marginals_.project(f.a, by_a, f.b, by_b, slot);
  out.covariance += unpack<Space>(f.information).inverse();
  return true;
}

template <class Space>
void ClosureJudge<Space>::consider(int factor, bool compare) noexcept {
  fresh_ = state_[factor] == ClosureState::kNone;
  if (fresh_) closures_[closure_count_++] = factor;
  note_set_aside();
  const Factor<Space> &f = graph_.graph().factor(factor);
  if (state_[factor] == ClosureState::kTorn && graph_.group(f.a) != graph_.group(f.b)) return;
  turn(factor, ClosureState::kWaiting);
  doubt_ = 1.0;
  beyond_[factor] = 0.0F;
  measure_extent();
  if (graph_.group(f.a) != graph_.group(f.b))
    return policy_.wants_support ? join_if_paired(factor) : accept(factor);
  if (policy_.wants_support && compare && borne_out(factor)) {
    accept(factor);
    const auto others = agreeing_;
    fresh_ = false;
    for (const int other : others)
      if ((state_[other] == ClosureState::kWaiting || state_[other] == ClosureState::kRejected) &&
          borne_out(other))
        accept(other);
    return;
  }
  Innovation own;
  if (!measure(factor, 1, own)) return;
  chance_[factor] = static_cast<float>(chance(own.covariance));
  const double chi2 = own.e.dot(own.covariance.inverse() * own.e);
  beyond_[factor] = static_cast<float>(chi2 / (gate_ * scale()));
  if (chi2 > gate_ * scale()) return reject(factor);
  if (chi2 < gate_ * strict_scale()) doubt_ = chance_[factor];
  if (!policy_.wants_support || chance_[factor] < sharp() || (compare && corroborated(factor, own)))
    accept(factor);
}

template <class Space>
void ClosureJudge<Space>::look_again(int count) noexcept {
  note_set_aside();
  for (int k = 0; k < std::min(count, closure_count_); ++k) {
    cursor_ = cursor_ + 1 < closure_count_ ? cursor_ + 1 : 0;
    const int factor = closures_[cursor_];
    const Factor<Space> &f = graph_.graph().factor(factor);
    if (state_[factor] == ClosureState::kForced || state_[factor] == ClosureState::kNoRoom)
      continue;
    const Tangent e = Space::error(f.z, relative_pose(graph_.graph(), f));
    const bool fits = e.dot(weigh(f, e)) < gate_ * scale();
    if (state_[factor] == ClosureState::kAccepted) {
      if (!fits && graph_.up_to_date()) reject(factor);
    } else if (fits || state_[factor] == ClosureState::kWaiting) {
      consider(factor, false);
    }
  }
}

// What the closure's chi2 would be if it did not pull the estimate towards
// itself (eq. 17).
template <class Space>
double ClosureJudge<Space>::without_it(int factor) noexcept {
  const Factor<Space> &f = graph_.graph().factor(factor);
  const auto rel = relative_pose(graph_.graph(), f);
  const Tangent e = Space::error(f.z, rel);
  if (!marginals_.known(f.a, f.b)) return e.dot(weigh(f, e));
  Block by_a, by_b;
  Space::jacobians(f.z, rel, e, by_a, by_b);
  const Block information = unpack<Space>(f.information);
  const Block known = marginals_.project(f.a, by_a, f.b, by_b);
  const Block without = (Block::Identity() - f.weight * known * information).inverse();
  const Tangent free = without * e;
  const Block covariance = without * known + information.inverse();
  const double chi2 = free.dot(covariance.inverse() * free);
  return std::isfinite(chi2) ? chi2 : 0.0;
}

template <class Space>
bool ClosureJudge<Space>::review() noexcept {
  note_set_aside();
  measure_extent();
  const bool hasty = std::exchange(hasty_, true);
  bool changed = false;
  int worst = -1;
  int likeliest = -1;  // of those that nothing speaks for or against
  // Where nothing at all is wrong there is no reason for doubt.
  double least = rejected_ == 0 ? std::numeric_limits<double>::infinity() : 1.0;
  const double gate = gate_ * scale();
  double most = gate;
  for (int k = 0; k < closure_count_; ++k) {
    const int factor = closures_[k];
    const Factor<Space> &f = graph_.graph().factor(factor);
    const Tangent e = Space::error(f.z, relative_pose(graph_.graph(), f));
    const double chi2 = e.dot(weigh(f, e));
    if (state_[factor] == ClosureState::kAccepted) {
      const double alone = chi2 < 0.05 * gate ? chi2 : without_it(factor);
      if (chi2 > 4.0 * gate) {
        reject(factor);
        changed = true;
      } else if (std::max(chi2, alone) > most &&
                 !(chi2 < gate && policy_.wants_support && borne_out(factor))) {
        // What its neighbours bear out would be back in the next round, and out again.
        most = std::max(chi2, alone);
        worst = factor;
      }
    } else if (state_[factor] != ClosureState::kForced && state_[factor] != ClosureState::kNoRoom) {
      const ClosureState before = state_[factor];
      if (hasty && before == ClosureState::kRejected && beyond_[factor] > kFar) continue;
      consider(factor);
      changed = changed || (before != state_[factor] && state_[factor] == ClosureState::kAccepted);
      if (state_[factor] == ClosureState::kWaiting && doubt_ < least &&
          graph_.group(f.a) == graph_.group(f.b)) {
        least = doubt_;
        likeliest = factor;
      }
    }
  }
  if (worst >= 0 && !changed) {
    reject(worst);
    changed = true;
  } else if (likeliest >= 0 && !changed && (rejected_ == 0 || by_chance(least) < kByChance)) {
    if (rejected_ > 0) {
      accept(likeliest);
    } else {
      for (const int factor : closures()) {
        const Factor<Space> &f = graph_.graph().factor(factor);
        if (state_[factor] == ClosureState::kWaiting && graph_.group(f.a) == graph_.group(f.b))
          accept(factor);
      }
    }
    changed = true;
  }
  if (changed) return true;
  hasty_ = false;
  return hasty && review();
}

template <class Space>
bool ClosureJudge<Space>::drop_misfits() noexcept {
  const double gate = gate_ * scale();
  bool dropped = false;
  for (const int factor : closures()) {
    if (state_[factor] != ClosureState::kAccepted) continue;
    const Factor<Space> &f = graph_.graph().factor(factor);
    const Tangent e = Space::error(f.z, relative_pose(graph_.graph(), f));
    if (e.dot(weigh(f, e)) <= gate) continue;
    reject(factor);
    dropped = true;
  }
  return dropped;
}

template <class Space>
bool ClosureJudge<Space>::alone_between(int factor) const noexcept {
  const auto groups = [&](int k) {
    const Factor<Space> &f = graph_.graph().factor(k);
    return std::minmax({graph_.group(f.a), graph_.group(f.b)});
  };
  const auto own = groups(factor);
  return own.first != own.second && std::ranges::none_of(closures(), [&](int other) {
           return other != factor && groups(other) == own;
         });
}

template <class Space>
void ClosureJudge<Space>::turn(int factor, ClosureState to) noexcept {
  accepted_ +=
      (to == ClosureState::kAccepted ? 1 : 0) - (state_[factor] == ClosureState::kAccepted ? 1 : 0);
  rejected_ +=
      (to == ClosureState::kRejected ? 1 : 0) - (state_[factor] == ClosureState::kRejected ? 1 : 0);
  state_[factor] = to;
}

template <class Space>
void ClosureJudge<Space>::accept(int factor) noexcept {
  if (state_[factor] == ClosureState::kAccepted) return;
  turn(factor, ClosureState::kAccepted);
  graph_.set_weight(factor, 1.0);
}

template <class Space>
void ClosureJudge<Space>::reject(int factor) noexcept {
  const bool in = state_[factor] == ClosureState::kAccepted;
  turn(factor, ClosureState::kRejected);
  if (in) graph_.set_weight(factor, 0.0);
}

template <class Space>
void ClosureJudge<Space>::tear(int factor) noexcept {
  bar(factor);
  turn(factor, ClosureState::kTorn);
}

template <class Space>
void ClosureJudge<Space>::force(int factor, bool accept) noexcept {
  turn(factor, ClosureState::kForced);
  graph_.set_weight(factor, accept ? 1.0 : 0.0);
}

template <class Space>
void ClosureJudge<Space>::begin_anew(std::span<const int> order) noexcept {
  note_set_aside();
  closure_count_ = extent_nodes_ = 0;
  hasty_ = false;
  for (const int factor : order)
    if (state_[factor] != ClosureState::kNone) closures_[closure_count_++] = factor;
  for (int k = 0; k < closure_count_; ++k) {
    const int factor = closures_[k];
    if (state_[factor] == ClosureState::kForced) continue;
    if (state_[factor] == ClosureState::kAccepted) graph_.set_weight(factor, 0.0);
    turn(factor, ClosureState::kWaiting);
  }
}

template <class Space>
void ClosureJudge<Space>::forget(int factor) noexcept {
  if (state_[factor] == ClosureState::kNone) return;
  turn(factor, ClosureState::kNone);
  const auto end = closures_.begin() + closure_count_;
  closure_count_ =
      static_cast<int>(std::remove(closures_.begin(), end, factor) - closures_.begin());
  cursor_ = 0;
}

// Closures that the graph has set aside say nothing: they are no longer of those that are in.
template <class Space>
void ClosureJudge<Space>::note_set_aside() noexcept {
  if (set_aside_ == graph_.overflows()) return;
  set_aside_ = graph_.overflows();
  for (int k = 0; k < closure_count_; ++k) {
    const int factor = closures_[k];
    if (!graph_.graph().factor(factor).state.aside || state_[factor] == ClosureState::kForced)
      continue;
    turn(factor, ClosureState::kNoRoom);
    graph_.set_weight(factor, 0.0);
  }
}

template <class Space>
void ClosureJudge<Space>::measure_extent() noexcept {
  const auto &graph = graph_.graph();
  if (extent_nodes_ > 0 && graph.node_end() < extent_nodes_ + extent_nodes_ / 8) return;
  extent_nodes_ = std::max(1, graph.node_end());
  extent_ = 1.0;
  for (int i = 0; i < graph.node_end(); ++i)
    if (graph.node(i).used)
      extent_ = std::max(
          extent_, translation_extent(graph.node(i).pose, graph.node(graph.node(i).group).pose));
}

template class ClosureJudge<PlanarSpace>;
template class ClosureJudge<SpatialSpace>;

}  // namespace maplet
