// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/closure_judge.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/skeleton/linearise.hpp"

namespace maplet {

namespace {

/// Chi-square, 99 %, three and six degrees of freedom.
template <class Space>
constexpr double kGate = Space::kDim == 6 ? 16.812 : 11.345;
/// A test is sharp when a closure between two random places passes it more
/// seldom than this.
constexpr double kSharp = 1e-3;
/// Waiting closures that a new one is compared with.
constexpr int kCompared = 8;

double translation_extent(const Se2 &a, const Se2 &b) noexcept {
  return std::hypot(a.x - b.x, a.y - b.y);
}
double translation_extent(const Se3 &a, const Se3 &b) noexcept { return (a.t - b.t).norm(); }

}  // namespace

template <class Space>
ClosureJudge<Space>::ClosureJudge(PoseGraph<Space> &graph, Arena &arena, const JudgePolicy &policy)
    : graph_{graph},
      policy_{policy},
      gate_{kGate<Space> * policy.inflation * policy.inflation},
      marginals_{graph.graph(), graph.elimination(), arena},
      state_{arena.make_array<ClosureState>(graph.graph().max_factors(), "skeleton/closures")},
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

// The share of all relative poses in the map that the gate would let pass.
template <class Space>
double ClosureJudge<Space>::chance(const Block &covariance) const noexcept {
  const double volume = std::sqrt(std::max(0.0, covariance.determinant()));
  if constexpr (Space::kDim == 3) {
    const double gate = 4.0 / 3.0 * M_PI * std::pow(kGate<Space>, 1.5) * volume;
    return gate / (4.0 * extent_ * extent_ * 2.0 * M_PI);
  } else {
    const double gate = std::pow(M_PI, 3) / 6.0 * std::pow(kGate<Space>, 3) * volume;
    return gate / (8.0 * std::pow(extent_, 3) * 8.0 * M_PI * M_PI);
  }
}

// A closure that was told twice does not bear itself out.
template <class Space>
bool ClosureJudge<Space>::same_places(int factor, int other) const noexcept {
  const Factor<Space> &f = graph_.graph().factor(factor);
  const Factor<Space> &g = graph_.graph().factor(other);
  return (f.a == g.a && f.b == g.b) || (f.a == g.b && f.b == g.a);
}

// Whether, given this closure, one of those that wait passes a sharp test; that
// one is accepted too.
template <class Space>
bool ClosureJudge<Space>::corroborated(int factor, const Innovation &own) noexcept {
  // own is in slot 1.
  const Block own_inverse = own.covariance.inverse();
  int compared = 0;
  for (int k = closure_count_ - 1; k >= 0 && compared < kCompared; --k) {
    const int other = closures_[k];
    if (state_[other] != ClosureState::kWaiting || same_places(factor, other)) continue;
    ++compared;
    Innovation theirs;
    if (!measure(other, 0, theirs)) continue;
    const Block cross = marginals_.cross();  // own with theirs
    const Block gain = cross.transpose() * own_inverse;
    const Block left = theirs.covariance - gain * cross;
    const Tangent e = theirs.e - gain * own.e;
    if (e.dot(left.inverse() * e) > gate_ || chance(left) > kSharp) continue;
    accept(other);
    return true;
  }
  return false;
}

// chi2 of the cycle that two closures between the same two groups make (eq.
// 18); < 0: none.
template <class Space>
double ClosureJudge<Space>::cycle(int factor, int other) noexcept {
  const auto &graph = graph_.graph();
  const Factor<Space> &f = graph.factor(factor);
  const Factor<Space> &g = graph.factor(other);
  const bool same =
      graph_.group(f.a) == graph_.group(g.a) && graph_.group(f.b) == graph_.group(g.b);
  const bool turned =
      graph_.group(f.a) == graph_.group(g.b) && graph_.group(f.b) == graph_.group(g.a);
  const int ga = same ? g.a : g.b;
  const int gb = same ? g.b : g.a;
  if (!(same || turned) || !marginals_.known(f.a, ga) || !marginals_.known(f.b, gb)) return -1.0;
  const auto between = [&](int i, int j) {
    return Space::between(graph.node(i).pose, graph.node(j).pose);
  };
  const auto adjoint_of_inverse = [](const auto &t) {
    Block by_a, by_b;
    Space::jacobians(t, t, Tangent::Zero(), by_a, by_b);
    return Block{-by_a};
  };
  const typename Space::Pose identity{};
  const auto z = same ? g.z : Space::between(g.z, identity);
  const auto back = between(gb, f.b);
  Block noise_g = unpack<Space>(g.information).inverse();
  if (!same) {  // its noise is in the tangent of g.b, which is ga: carry it over
    const Block ad = adjoint_of_inverse(z);
    noise_g = ad * noise_g * ad.transpose();
  }
  const Block ad_z_back = adjoint_of_inverse(Space::compose(z, back));
  const Block ad_back = adjoint_of_inverse(back);
  Block covariance = unpack<Space>(f.information).inverse();
  if (f.a != ga) covariance += ad_z_back * marginals_.of(f.a, ga) * ad_z_back.transpose();
  covariance += ad_back * noise_g * ad_back.transpose();
  if (gb != f.b) covariance += marginals_.of(gb, f.b);
  const auto around = Space::compose(Space::compose(between(f.a, ga), z), back);
  const Tangent e = Space::error(f.z, around);
  return e.dot(covariance.inverse() * e);
}

// Two groups become one when two closures between them agree, at different
// places.
template <class Space>
void ClosureJudge<Space>::join_if_paired(int factor) noexcept {
  int compared = 0;
  for (int k = closure_count_ - 1; k >= 0 && compared < 4 * kCompared; --k) {
    const int other = closures_[k];
    if (state_[other] != ClosureState::kWaiting || same_places(factor, other)) continue;
    const double chi2 = cycle(factor, other);
    if (chi2 < 0.0) continue;
    ++compared;
    if (chi2 > gate_) continue;
    accept(factor);
    graph_.flush();
    return consider(other);
  }
}

template <class Space>
void ClosureJudge<Space>::consider(int factor, bool compare) noexcept {
  if (state_[factor] == ClosureState::kNone) closures_[closure_count_++] = factor;
  state_[factor] = ClosureState::kWaiting;
  measure_extent();
  const Factor<Space> &f = graph_.graph().factor(factor);
  if (graph_.group(f.a) != graph_.group(f.b))
    return policy_.wants_support ? join_if_paired(factor) : accept(factor);
  Innovation own;
  if (!measure(factor, 1, own)) return;
  if (own.e.dot(own.covariance.inverse() * own.e) > gate_) return reject(factor);
  if (!policy_.wants_support || chance(own.covariance) < kSharp ||
      (compare && corroborated(factor, own)))
    accept(factor);
}

template <class Space>
void ClosureJudge<Space>::look_again(int count) noexcept {
  for (int k = 0; k < std::min(count, closure_count_); ++k) {
    cursor_ = cursor_ + 1 < closure_count_ ? cursor_ + 1 : 0;
    const int factor = closures_[cursor_];
    const Factor<Space> &f = graph_.graph().factor(factor);
    if (state_[factor] == ClosureState::kForced) continue;
    const Tangent e = Space::error(f.z, relative_pose(graph_.graph(), f));
    const bool fits = e.dot(weigh(f, e)) < gate_;
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
  const Block known = marginals_.project(f.a, by_a, f.b, by_b) * unpack<Space>(f.information);
  const Tangent free = (Block::Identity() - f.weight * known).partialPivLu().solve(e);
  return free.allFinite() ? free.dot(weigh(f, free)) : 0.0;
}

template <class Space>
bool ClosureJudge<Space>::review() noexcept {
  measure_extent();
  bool changed = false;
  int worst = -1;
  double most = gate_;
  for (int k = 0; k < closure_count_; ++k) {
    const int factor = closures_[k];
    const Factor<Space> &f = graph_.graph().factor(factor);
    const Tangent e = Space::error(f.z, relative_pose(graph_.graph(), f));
    const double chi2 = e.dot(weigh(f, e));
    if (state_[factor] == ClosureState::kAccepted) {
      const double alone = chi2 < 0.2 * gate_ ? chi2 : without_it(factor);
      if (chi2 > 4.0 * gate_) {
        reject(factor);
        changed = true;
      } else if (std::max(chi2, alone) > most) {
        most = std::max(chi2, alone);
        worst = factor;
      }
    } else if (state_[factor] != ClosureState::kForced) {
      const ClosureState before = state_[factor];
      consider(factor);
      changed = changed || (before != state_[factor] && state_[factor] == ClosureState::kAccepted);
    }
  }
  if (worst >= 0 && !changed) {
    reject(worst);
    changed = true;
  }
  return changed;
}

template <class Space>
void ClosureJudge<Space>::accept(int factor) noexcept {
  if (state_[factor] == ClosureState::kAccepted) return;
  state_[factor] = ClosureState::kAccepted;
  graph_.set_weight(factor, 1.0);
}

template <class Space>
void ClosureJudge<Space>::reject(int factor) noexcept {
  const bool in = state_[factor] == ClosureState::kAccepted;
  state_[factor] = ClosureState::kRejected;
  if (in) graph_.set_weight(factor, 0.0);
}

template <class Space>
void ClosureJudge<Space>::force(int factor, bool accept) noexcept {
  state_[factor] = ClosureState::kForced;
  graph_.set_weight(factor, accept ? 1.0 : 0.0);
}

template <class Space>
void ClosureJudge<Space>::begin_anew() noexcept {
  for (int k = 0; k < closure_count_; ++k) {
    const int factor = closures_[k];
    if (state_[factor] == ClosureState::kForced) continue;
    if (state_[factor] == ClosureState::kAccepted) graph_.set_weight(factor, 0.0);
    state_[factor] = ClosureState::kWaiting;
  }
}

template <class Space>
void ClosureJudge<Space>::forget(int factor) noexcept {
  if (state_[factor] == ClosureState::kNone) return;
  state_[factor] = ClosureState::kNone;
  const auto end = closures_.begin() + closure_count_;
  closure_count_ =
      static_cast<int>(std::remove(closures_.begin(), end, factor) - closures_.begin());
  cursor_ = 0;
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
