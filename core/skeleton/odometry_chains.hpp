// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <span>

#include "core/base/arena.hpp"
#include "core/skeleton/relation.hpp"

namespace maplet {

/// Every agent's odometry strung together, and nothing else: what two poses of one agent are to
/// each other without any closure. Closures are tested against each other by it.
///
/// The covariances are carried over to the start of the chain, where they simply add up, so that
/// any pair's is a difference of two sums.
///
/// Memory   a pose, a block and an integer a node, from the arena.
/// Time     O(1).
/// Math     docs/math/skeleton.md, eq. 28.
template <class Space>
class OdometryChains {
 public:
  using Pose = typename Space::Pose;
  using Block = typename Space::Block;

  OdometryChains(int max_nodes, Arena& arena)
      : links_{arena.make_array<Link>(max_nodes, "skeleton/chains")} {}

  /// b follows a on one agent's path. A node that nothing led to begins a chain; one that has been
  /// led to stays where it was.
  void append(int a, int b, const Relation<Space>& a_b) noexcept {
    Link& from = links_[a];
    if (from.chain < 0) from = {a, 0, kNone, kNone, Pose{}, Block::Zero()};
    if (links_[b].chain >= 0) return;
    const Pose at = Space::compose(from.T_start, a_b.T);
    const Block ad = adjoint_of_inverse<Space>(Space::between(at, Pose{}));  // Ad(T_start_b)
    links_[b] = {from.chain, from.step + 1,
                 a,          kNone,
                 at,         from.spread + ad * a_b.covariance * ad.transpose()};
    if (from.next == kNone) from.next = b;
  }
  void forget(int node) noexcept {
    const Link gone = links_[node];
    if (gone.before != kNone) links_[gone.before].next = gone.next;
    if (gone.next != kNone) links_[gone.next].before = gone.before;
    links_[node] = {};
  }
  void clear() noexcept {
    for (Link& l : links_) l = {};
  }

  /// The node that a node's chain begins with; -1: it is in none.
  [[nodiscard]] int chain(int node) const noexcept { return links_[node].chain; }
  /// How many links the two are apart. @pre related(a, b)
  [[nodiscard]] int apart(int a, int b) const noexcept {
    return std::abs(links_[a].step - links_[b].step);
  }
  /// Calls visit(node) for a node of a chain and those up to `reach` links before and after it.
  template <class Visit>
  void for_each_near(int node, int reach, Visit&& visit) const {
    visit(node);
    int n = links_[node].before;
    for (int k = 0; k < reach && n != kNone; ++k, n = links_[n].before) visit(n);
    n = links_[node].next;
    for (int k = 0; k < reach && n != kNone; ++k, n = links_[n].next) visit(n);
  }
  [[nodiscard]] bool related(int a, int b) const noexcept {
    return a == b || (links_[a].chain >= 0 && links_[a].chain == links_[b].chain);
  }
  /// T_a_b by odometry alone. @pre related(a, b)
  [[nodiscard]] Relation<Space> between(int a, int b) const noexcept {
    if (a == b) return {};
    const Link& from = links_[a];
    const Link& to = links_[b];
    const Block ad = adjoint_of_inverse<Space>(to.T_start);
    Block spread = to.spread - from.spread;
    if (spread.trace() < 0.0) spread = -spread;  // b came before a
    return {Space::between(from.T_start, to.T_start), ad * spread * ad.transpose()};
  }

 private:
  static constexpr int kNone = -1;
  struct Link {
    int chain = kNone;   ///< the node that it starts with
    int step = 0;        ///< from there
    int before = kNone;  ///< on the path
    int next = kNone;
    Pose T_start;  ///< T_start_node
    Block spread = Block::Zero();
  };
  std::span<Link> links_;
};

}  // namespace maplet
