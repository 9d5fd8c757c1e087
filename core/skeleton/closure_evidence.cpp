// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What speaks for a closure: how sharp its test is, and which others say the same.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/skeleton/closure_judge.hpp"
#include "core/skeleton/linearise.hpp"

namespace maplet {

namespace {

/// Closures between chains this many links apart are compared by odometry.
constexpr int kReach = 12;
/// A comparison that chance passes more often than this says nothing.
constexpr double kBlunt = 1e-2;
/// Evidence that is enough, in decades against chance.
constexpr double kEvidence = 5.0;
/// Errors may be this much larger than those of the others, and no smaller share of what their
/// covariances say is believed: the worst of a hundred are far from Gaussian.
constexpr double kMargin = 2.5;
constexpr double kLeastScale = 0.08;
constexpr double kMostScale =
    1.4;  // chi-square, 99.9 %: covariances that are right lose hardly any
/// Waiting closures that a new one is compared with.
constexpr int kCompared = 8;

}  // namespace

// How large errors really are, of what their covariances say: from the closures that count. Those
// of many data sets are far too cautious, and a wrong one would hide in what they allow.
template <class Space>
double ClosureJudge<Space>::size_of_errors() const noexcept {
  constexpr double kPrior = 30.0;  // measurements' worth of what cycles say
  const double dof = static_cast<double>(Space::kDim) * accepted_;
  return std::max((graph_.last_chi2() + kPrior * local_scale_) / (dof + kPrior),
                  kLeastScale / kMargin);
}

template <class Space>
double ClosureJudge<Space>::scale() const noexcept {
  return policy_.wants_support ? std::min(kMargin * size_of_errors(), kMostScale) : 1.0;
}

// Of one that nothing else speaks for: it must fit as others do, with no margin.
template <class Space>
double ClosureJudge<Space>::strict_scale() const noexcept {
  return policy_.wants_support ? std::min(size_of_errors(), 1.0) : 1.0;
}

// Cycles of two closures next to each other and the odometry between them are short and need no
// map: the median of those that agree says how large errors really are before any map does.
template <class Space>
void ClosureJudge<Space>::note_cycle(double chi2) noexcept {
  constexpr double kMedian = Space::kDim == 6 ? 5.348 : 2.366;  // of chi-square
  constexpr double kPrior = 3.0;
  const int bin = std::clamp(static_cast<int>(std::log2(chi2 / kMedian + 1e-9) + kZeroBin), 0,
                             static_cast<int>(cycles_.size()) - 1);
  ++cycles_[bin];
  ++cycle_count_;
  int median = 0;
  for (int sum = cycles_[0]; 2 * sum < cycle_count_; sum += cycles_[median]) ++median;
  const double typical = std::min(1.0, std::exp2(median + 0.5 - kZeroBin));
  local_scale_ = (cycle_count_ * typical + kPrior) / (cycle_count_ + kPrior);
}

// The share of all relative poses in the map that the gate would let pass.
template <class Space>
double ClosureJudge<Space>::chance(const Block &covariance) const noexcept {
  const double volume =
      std::sqrt(std::max(0.0, covariance.determinant()) * std::pow(scale(), Space::kDim));
  if constexpr (Space::kDim == 3) {
    const double gate = 4.0 / 3.0 * M_PI * std::pow(kGate, 1.5) * volume;
    return gate / (4.0 * extent_ * extent_ * 2.0 * M_PI);
  } else {
    const double gate = std::pow(M_PI, 3) / 6.0 * std::pow(kGate, 3) * volume;
    return gate / (8.0 * std::pow(extent_, 3) * 8.0 * M_PI * M_PI);
  }
}

// How many of those that are out or wait chance would let pass, if all strict tests at most as
// blunt as the limit were believed: each has its own, and most are far sharper than a lone one's.
template <class Space>
double ClosureJudge<Space>::by_chance(double limit) const noexcept {
  double expected = 0.0;
  for (const int factor : closures())
    if ((state_[factor] == ClosureState::kRejected || state_[factor] == ClosureState::kWaiting) &&
        chance_[factor] <= limit)
      expected += chance_[factor];
  return expected * std::pow(strict_scale() / scale(), 0.5 * Space::kDim);
}

// A closure that was told twice does not bear itself out.
template <class Space>
bool ClosureJudge<Space>::same_places(int factor, int other) const noexcept {
  const Factor<Space> &f = graph_.graph().factor(factor);
  const Factor<Space> &g = graph_.graph().factor(other);
  return (f.a == g.a && f.b == g.b) || (f.a == g.b && f.b == g.a);
}

// Whether one of those that wait passes a sharp test given this closure, and this one given it:
// else the other is sharp by itself and has nothing to say about this one. That one is accepted
// too.
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
    const double given_own = chance(left);
    const double given_theirs = chance(own.covariance) * given_own / chance(theirs.covariance);
    if (e.dot(left.inverse() * e) > gate_ * scale() ||
        !(std::max(given_own, given_theirs) < sharp()))
      continue;
    accept(other);
    return true;
  }
  return false;
}

// Whether closures next to it on the agents' paths say the same, so many and so sharply that chance
// does not: by odometry from one to the other alone, whatever the map has come to. agreeing_ is
// who.
template <class Space>
bool ClosureJudge<Space>::borne_out(int factor) noexcept {
  agreeing_.clear();
  if (chains_ == nullptr) return false;
  const auto &graph = graph_.graph();
  const Factor<Space> &f = graph.factor(factor);
  const Relation<Space> own{f.z, unpack<Space>(f.information).inverse()};
  double evidence = 0.0;  // decades
  int compared = 0;
  chains_->for_each_near(f.a, kReach, [&](int a) {
    graph.for_each_incident(a, [&](int other, int b) {
      if (other == factor || b == -1 || state_[other] == ClosureState::kNone ||
          same_places(factor, other) || !chains_->related(b, f.b) ||
          chains_->apart(b, f.b) > kReach)
        return;
      ++compared;
      const Factor<Space> &g = graph.factor(other);
      Relation<Space> theirs{g.z, unpack<Space>(g.information).inverse()};
      if (g.a != a) theirs = theirs.inverse();
      const Relation<Space> around =
          chains_->between(f.a, a).then(theirs).then(chains_->between(b, f.b));
      const Tangent e = Space::error(own.T, around.T);
      const Block covariance = own.covariance + around.covariance;
      const double by_chance = usual_ * chance(covariance);
      if (by_chance < kBlunt)
        shuffle(factor, covariance, chains_->between(f.a, a).T, chains_->between(b, f.b).T);
      const double chi2 = e.dot(covariance.inverse() * e);
      if (fresh_ && chi2 < kGate) note_cycle(chi2);
      if (!(by_chance < kBlunt) || !(chi2 < gate_ * scale())) return;
      evidence -= std::log10(by_chance);
      if (!full(agreeing_)) agreeing_.push_back(other);
    });
  });
  for (int k = 0; k < static_cast<int>(agreeing_.size()); ++k)  // so many ways to choose them
    evidence -= std::log10(static_cast<double>(compared - k) / (k + 1));
  return evidence > kEvidence;
}

// How often closures next to each other agree that have nothing to do with each other: this one
// with another one's transform in its neighbour's place. Places that look alike stand on grids and
// their transforms are short; chance is kinder to those than to poses drawn from all of the map.
template <class Space>
void ClosureJudge<Space>::shuffle(int factor, const Block &covariance, const Pose &before,
                                  const Pose &after) noexcept {
  constexpr double kPrior = 0.01;
  draws_ = draws_ * 6364136223846793005ULL + 1442695040888963407ULL;
  const auto k =
      static_cast<std::size_t>((draws_ >> 33) % static_cast<std::uint64_t>(closure_count_));
  const auto &z = graph_.graph().factor(closures_[k]).z;
  if (closures_[k] == factor) return;
  const Tangent e = Space::error(graph_.graph().factor(factor).z,
                                 Space::compose(Space::compose(before, z), after));
  expected_ += chance(covariance);
  if (e.dot(covariance.inverse() * e) < gate_ * scale()) seen_ += 1.0;
  usual_ = std::max(1.0, (seen_ + kPrior) / (expected_ + kPrior));
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

#define MAPLET_INSTANTIATE(Space)                                                                 \
  template double ClosureJudge<Space>::size_of_errors() const noexcept;                           \
  template double ClosureJudge<Space>::scale() const noexcept;                                    \
  template double ClosureJudge<Space>::strict_scale() const noexcept;                             \
  template double ClosureJudge<Space>::chance(const ClosureJudge<Space>::Block &) const noexcept; \
  template double ClosureJudge<Space>::by_chance(double) const noexcept;                          \
  template void ClosureJudge<Space>::note_cycle(double) noexcept;                                 \
  template bool ClosureJudge<Space>::same_places(int, int) const noexcept;                        \
  template bool ClosureJudge<Space>::corroborated(                                                \
      int, const ClosureJudge<Space>::Innovation &) noexcept;                                     \
  template bool ClosureJudge<Space>::borne_out(int) noexcept;                                     \
  template void ClosureJudge<Space>::shuffle(int, const ClosureJudge<Space>::Block &,             \
                                             const ClosureJudge<Space>::Pose &,                   \
                                             const ClosureJudge<Space>::Pose &) noexcept;         \
  template double ClosureJudge<Space>::cycle(int, int) noexcept;                                  \
  template void ClosureJudge<Space>::join_if_paired(int) noexcept;
MAPLET_INSTANTIATE(PlanarSpace)
MAPLET_INSTANTIATE(SpatialSpace)
#undef MAPLET_INSTANTIATE

}  // namespace maplet
