// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <vector>

#include "core/skeleton/closure_judge.hpp"
#include "core/skeleton/closure_sets.hpp"
#include "tools/solve/graph_file.hpp"

namespace maplet::graphs {

[[nodiscard]] inline bool between_agents(const Edge& e) {
  return e.kind == FactorKind::kBetween && e.a >> 56 != e.b >> 56;
}

/// Which closures of a file to believe: as they come, and over the whole set at the end.
template <class Space>
class Closures {
 public:
  Closures(PoseGraph<Space>& solver, const GraphFile& file, Arena& arena)
      : solver_{solver},
        chains_{solver.graph().max_nodes(), arena},
        judge_{solver, arena, {}, &chains_},
        sets_{solver.graph(), chains_, most_between(file), arena} {
    between_.reserve(file.edges.size());
    undecided_.reserve(file.edges.size());
  }

  void odometry(int a, int b, const Relation<Space>& a_b) { chains_.append(a, b, a_b); }
  /// A closure that has been added with weight 0.
  void add(int factor, bool between) {
    if (between) between_.push_back(factor);
    undecided_.push_back(factor);
  }
  void forget(int factor) {
    std::erase(between_, factor);
    std::erase(undecided_, factor);
    judge_.forget(factor);
  }

  void forget_node(int node) { chains_.forget(node); }

  /// After a step. Closures wait until the graph has eliminated their poses, which it does for its
  /// own reasons, or for some steps: flushing it for each of them would undo what it saves by being
  /// lazy.
  void decide(bool all) {
    if (!undecided_.empty()) {
      if (all) solver_.flush();
      std::size_t kept = 0;
      for (const int f : undecided_) {
        const Factor<Space>& factor = solver_.graph().factor(f);
        if (all || judge_.marginals().known(factor.a, factor.b)) {
          judge_.consider(f);
        } else {
          undecided_[kept++] = f;
        }
      }
      undecided_.resize(kept);
    }
    judge_.look_again(kLooksPerStep);
  }
  /// At a settled estimate. @return whether a verdict changed
  [[nodiscard]] bool review() {
    return judge_.review() || judge_.accept_lone([&](int f) {
      return std::find(between_.begin(), between_.end(), f) == between_.end();
    });
  }
  /// No more reviews: what does not fit goes, and nothing comes. @return whether a verdict changed
  [[nodiscard]] bool drop_misfits() { return judge_.drop_misfits(); }
  /// Closures between two agents stand or fall as sets that agree by odometry alone.
  /// @return whether there are any
  bool choose_sets() {
    sets_.choose(between_, [&](int f, bool agrees, auto sizes) {
      if (sizes.set > 1 || !agrees) judge_.force(f, agrees);
    });
    return !between_.empty();
  }

 private:
  static constexpr int kLooksPerStep = 4;
  static constexpr int kMostCompared = 2000;

  [[nodiscard]] static int most_between(const GraphFile& file) {
    const auto count = std::count_if(file.edges.begin(), file.edges.end(), between_agents);
    return std::clamp(static_cast<int>(count), 1, kMostCompared);
  }

  PoseGraph<Space>& solver_;
  OdometryChains<Space> chains_;
  ClosureJudge<Space> judge_;
  ClosureSets<Space> sets_;
  std::vector<int> between_;    ///< closures between agents
  std::vector<int> undecided_;  ///< closures that nobody has looked at yet
};

}  // namespace maplet::graphs
