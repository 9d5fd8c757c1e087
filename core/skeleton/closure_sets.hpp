// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/LU>
#include <span>

#include "core/skeleton/consistent_set.hpp"
#include "core/skeleton/linearise.hpp"
#include "core/skeleton/odometry_chains.hpp"

namespace maplet {

/// Which closures between two agents agree with each other by the agents' odometry alone: the
/// largest set that does, pair by pair. Nothing else relates two agents before they meet, and
/// closures that are wrong seldom agree.
///
/// Memory   a list of `capacity` and ConsistentSet, from the arena.
/// Time     O(closures^2) for each pair of agents.
/// Math     docs/math/skeleton.md, eq. 18.
template <class Space>
class ClosureSets {
 public:
  using Block = typename Space::Block;

  /// @param capacity  closures compared, of one pair of agents; those after are let pass
  ClosureSets(const Graph<Space>& graph, const OdometryChains<Space>& chains, int capacity,
              Arena& arena)
      : graph_{graph},
        chains_{chains},
        set_{capacity, arena},
        list_{arena.make_array<int>(capacity, "skeleton/consistency")},
        member_{arena.make_array<bool>(capacity, "skeleton/consistency")} {}

  struct Sizes {
    int set;    ///< of the largest set
    int rival;  ///< of the largest one of the others
  };

  /// Calls verdict(factor, agrees, sizes) for each closure between two chains. Ties go to whom the
  /// list names first.
  template <class Verdict>
  void choose(std::span<const int> closures, Verdict&& verdict) noexcept {
    for (std::size_t first = 0; first < closures.size(); ++first) {
      const auto pair = pair_of(closures[first]);
      if (pair.first == pair.second) continue;
      bool done = false;
      for (std::size_t k = 0; k < first && !done; ++k) done = pair_of(closures[k]) == pair;
      if (done) continue;
      int count = 0;
      for (std::size_t k = first; k < closures.size() && count < set_.capacity(); ++k)
        if (pair_of(closures[k]) == pair) list_[count++] = closures[k];
      set_.clear(count);
      for (int i = 0; i < count; ++i)
        for (int j = 0; j < i; ++j)
          if (chi2(list_[i], list_[j]) < kGate) set_.agree(i, j);
      Sizes sizes{};
      sizes.set = set_.find(member_);
      sizes.rival = set_.find_apart_from(member_);
      const bool none = sizes.set == 1 && count > 1;  // no two agree: nobody is borne out
      for (int i = 0; i < count; ++i) verdict(list_[i], member_[i] && !none, sizes);
    }
  }

  /// Of the cycle that two closures between the same chains make.
  [[nodiscard]] double chi2(int f, int g) const noexcept {
    const Factor<Space>& one = graph_.factor(f);
    const Factor<Space>& two = graph_.factor(g);
    const bool turned = !chains_.related(one.a, two.a) || !chains_.related(one.b, two.b);
    Relation<Space> other = measured(two);
    if (turned) other = other.inverse();
    const int a = turned ? two.b : two.a;
    const int b = turned ? two.a : two.b;
    const Relation<Space> around =
        chains_.between(one.a, a).then(other).then(chains_.between(b, one.b));
    const Relation<Space> own = measured(one);
    const auto e = Space::error(own.T, around.T);
    return e.dot((own.covariance + around.covariance).inverse() * e);
  }

  /// The two chains, the lower one first; twice the same: not between two.
  [[nodiscard]] std::pair<int, int> pair_of(int factor) const noexcept {
    const Factor<Space>& f = graph_.factor(factor);
    const int a = chains_.chain(f.a);
    const int b = chains_.chain(f.b);
    if (a < 0 || b < 0) return {-1, -1};
    return a < b ? std::pair{a, b} : std::pair{b, a};
  }

 private:
  static constexpr double kGate = Space::kDim == 6 ? 16.812 : 11.345;  ///< chi-square, 99 %

  [[nodiscard]] static Relation<Space> measured(const Factor<Space>& f) noexcept {
    return {f.z, unpack<Space>(f.information).inverse()};
  }

  const Graph<Space>& graph_;
  const OdometryChains<Space>& chains_;
  ConsistentSet set_;
  std::span<int> list_;
  std::span<bool> member_;
};

}  // namespace maplet
