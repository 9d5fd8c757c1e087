// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/condenser.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/skeleton/linearise.hpp"
#include "core/skeleton/relation.hpp"

namespace maplet {

namespace {

template <class Block>
Block inverse_of(const Block& m) noexcept {
  return m.template selfadjointView<Eigen::Lower>().llt().solve(Block::Identity());
}

}  // namespace

template <class Space>
Condenser<Space>::Condenser(PoseGraph<Space>& graph, Marginals<Space>& marginals, Arena& arena)
    : graph_{graph},
      marginals_{marginals},
      gone_{arena.make_array<Contraction<Space>>(graph.graph().max_nodes() / 16 + 4,
                                                 "skeleton/condenser")},
      leverage_{arena.make_array<float>(graph.graph().max_factors(), "skeleton/condenser")},
      stack_{arena.make_array<int>(graph.graph().max_nodes(), "skeleton/condenser")},
      seen_{arena.make_array<std::int64_t>(graph.graph().max_nodes(), "skeleton/condenser")} {}

template <class Space>
bool Condenser<Space>::has_room(int nodes, int factors) const noexcept {
  const auto& g = graph_.graph();
  return g.node_count() + nodes <= g.max_nodes() && g.factor_count() + factors <= g.max_factors();
}

// The node's factors to other poses, one spoke a neighbour. @return false when there are too many
template <class Space>
bool Condenser<Space>::star_of(int node, Star& star) const noexcept {
  const auto& g = graph_.graph();
  bool fits = true;
  star.clear();
  g.for_each_incident(node, [&](int index, int other) {
    const Factor<Space>& f = g.factor(index);
    if (!f.state.active || f.kind != FactorKind::kBetween || !fits) return;
    Relation<Space> r{f.z, inverse_of(Block{f.weight * unpack<Space>(f.information)})};
    if (f.b == node) r = r.inverse();
    const Block information = inverse_of(r.covariance);
    const auto known =
        std::find_if(star.begin(), star.end(), [&](const Spoke& s) { return s.other == other; });
    if (known == star.end()) {
      fits = !full(star);
      if (fits) star.push_back({other, r.T, information});
      return;
    }
    const Block both = known->information + information;
    const Tangent apart = Space::error(known->z, r.T);
    known->z = Space::retract(known->z, inverse_of(both) * (information * apart));
    known->information = both;
  });
  return fits;
}

template <class Space>
int Condenser<Space>::hub_of(const Star& star, double& spread) noexcept {
  int hub = -1;
  spread = 0.0;
  for (int k = 0; k < static_cast<int>(star.size()); ++k) {
    const double trace = inverse_of(star[k].information).trace();
    if (hub >= 0 && !(trace < spread)) continue;
    hub = k;
    spread = trace;
  }
  return hub;
}

// The node that its hub tells best, dearer the more neighbours it relates. Until finish() what
// takes the place of its factors needs room beside them.
template <class Space>
int Condenser<Space>::least_informative() const noexcept {
  const auto& g = graph_.graph();
  const int room = g.max_factors() - g.factor_count();
  Star star;
  int least = -1;
  double lowest = 0.0;
  for (int i = 0; i < g.node_end(); ++i) {
    const Node<Space>& n = g.node(i);
    if (!n.used || n.retired || n.keep || n.point || n.group == i) continue;
    int factors = 0;
    g.for_each_incident(i, [&](int, int) { ++factors; });
    if (factors > room || !star_of(i, star)) continue;
    double spread = 0.0;
    (void)hub_of(star, spread);
    const double score = spread * std::max<double>(1.0, static_cast<double>(star.size()) - 1.0);
    if (least >= 0 &&
        (score > lowest || (score == lowest && !(n.seniority < g.node(least).seniority))))
      continue;
    least = i;
    lowest = score;
  }
  return least;
}

// What a node at a contracted place saw, told from the hub; ranges alone cannot be (eq. 25).
template <class Space>
void Condenser<Space>::move_sight(const Factor<Space>& sight, int hub, const Pose& T_hub_node,
                                  const Block& covariance) noexcept {
  constexpr int kPoint = Space::kPoint;
  if (sight.kind == FactorKind::kRange || sight.kind == FactorKind::kBearing) {
    ++factors_dropped_;
    return;
  }
  const auto& g = graph_.graph();
  const Pose rel = relative_pose(g, sight);
  // As the estimate has it, so that the gradient stays where it was, at the sight's own precision.
  const measure::Rows<Space> rows = measure::sight_rows(sight.kind, rel);
  const Eigen::Matrix<double, kPoint, kPoint> seen =
      rows.transpose() * (sight.weight * unpack<Space>(sight.information)) * rows;
  const auto residual = measure::error(sight, rel);
  const measure::Point<Space> at =
      measure::position(rel) -
      (seen.llt().solve(rows.transpose() * (sight.weight * weigh(sight, residual)))).eval();
  Factor<Space> there;  // derivative of the position by the node's pose
  there.kind = FactorKind::kPosition;
  Block by_node, ignored;
  measure::sight_jacobians<Space>(FactorKind::kPosition, measure::make_position(at), by_node,
                                  ignored);
  const Block spread = by_node * covariance * by_node.transpose();
  const auto turn = measure::rotation(T_hub_node);
  const Eigen::Matrix<double, kPoint, kPoint> total =
      turn * (seen.inverse() + spread.template topLeftCorner<kPoint, kPoint>()) * turn.transpose();
  Block information = Block::Zero();
  information.template topLeftCorner<kPoint, kPoint>() = total.inverse();
  if (!information.allFinite()) {
    ++factors_dropped_;
    return;
  }
  (void)graph_.add_sight(
      FactorKind::kPosition, hub, sight.b,
      measure::make_position(measure::Point<Space>{turn * at + measure::position(T_hub_node)}),
      information);
}

template <class Space>
void Condenser<Space>::contract(int node) noexcept {
  const auto& g = graph_.graph();
  Star star;
  (void)star_of(node, star);
  double spread = 0.0;
  const int hub = hub_of(star, spread);
  Relation<Space> to_hub;  // T_node_hub
  if (hub >= 0) to_hub = {star[hub].z, inverse_of(star[hub].information)};
  const Relation<Space> from_hub = to_hub.inverse();
  const int others = static_cast<int>(star.size()) - 1;
  g.for_each_incident(node, [&](int index, int) {
    const Factor<Space> f = g.factor(index);
    const bool counts = f.state.active && f.weight > 0.0;
    graph_.retire_factor(index);
    if (f.kind == FactorKind::kBetween && counts) return;  // in the star
    if (!counts || hub < 0 || f.b == node) {
      ++factors_dropped_;
    } else if (f.kind == FactorKind::kPrior) {
      const Relation<Space> at{f.z, inverse_of(Block{f.weight * unpack<Space>(f.information)})};
      const Relation<Space> moved = at.then(to_hub);
      (void)graph_.add_prior(star[hub].other, moved.T, inverse_of(moved.covariance));
    } else {
      move_sight(f, star[hub].other, from_hub.T, from_hub.covariance);
    }
  });
  for (int k = 0; k < static_cast<int>(star.size()); ++k) {
    if (k == hub) continue;
    Relation<Space> wide = from_hub;
    wide.covariance *= others;
    const Relation<Space> r = wide.then({star[k].z, inverse_of(star[k].information)});
    add_fused(star[hub].other, star[k].other, r.T, inverse_of(r.covariance));
  }
  graph_.retire_node(node);
  gone_[gone_count_++] = {node, hub >= 0 ? star[hub].other : -1, from_hub.T, from_hub.covariance};
  ++nodes_gone_;
}

// A factor between a and b, one with what another says of the two already.
template <class Space>
void Condenser<Space>::add_fused(int a, int b, Pose z, Block information) noexcept {
  const auto& g = graph_.graph();
  g.for_each_incident(a, [&](int index, int other) {
    const Factor<Space>& f = g.factor(index);
    if (other != b || !f.state.active || f.kind != FactorKind::kBetween || f.weight < 1.0) return;
    Relation<Space> r{f.z, inverse_of(unpack<Space>(f.information))};
    if (f.b == a) r = r.inverse();
    const Block theirs = inverse_of(r.covariance);
    const Block both = theirs + information;
    z = Space::retract(z, inverse_of(both) * (theirs * Space::error(z, r.T)));
    information = both;
    graph_.retire_factor(index);
  });
  (void)graph_.add_between(a, b, z, information);
}

template <class Space>
bool Condenser<Space>::connected_without(int factor) noexcept {
  const auto& g = graph_.graph();
  const Factor<Space>& cut = g.factor(factor);
  ++stamp_;
  int count = 0;
  const auto push = [&](int node) {
    if (node == PoseGraph<Space>::kNone || seen_[node] == stamp_) return;
    seen_[node] = stamp_;
    stack_[count++] = node;
  };
  push(cut.a);
  while (count > 0 && seen_[cut.b] != stamp_) {
    g.for_each_incident(stack_[--count], [&](int index, int other) {
      if (index != factor && g.factor(index).state.active &&
          g.factor(index).kind == FactorKind::kBetween)
        push(other);
    });
  }
  return seen_[cut.b] == stamp_;
}

// How much of what a factor says is its own: 1 for a bridge, 0 for what the others say as well.
template <class Space>
void Condenser<Space>::measure_leverage() noexcept {
  const auto& g = graph_.graph();
  for (int i = 0; i < g.factor_end(); ++i) {
    const Factor<Space>& f = g.factor(i);
    leverage_[i] = 2.0F;
    if (f.a == PoseGraph<Space>::kNone || f.state.retired || f.kind != FactorKind::kBetween)
      continue;
    if (!f.state.active) {
      leverage_[i] = 0.0F;
      continue;
    }
    if (!marginals_.known(f.a, f.b)) continue;
    Block by_a, by_b;
    const auto rel = relative_pose(g, f);
    Space::jacobians(f.z, rel, Space::error(f.z, rel), by_a, by_b);
    const Block known = marginals_.project(f.a, by_a, f.b, by_b);
    leverage_[i] =
        static_cast<float>(f.weight * (known * unpack<Space>(f.information)).trace() / Space::kDim);
  }
}

// Drops factors that the others say already, the most redundant first (eq. 26). @return how many
template <class Space>
int Condenser<Space>::thin_out(int wanted) noexcept {
  const auto& g = graph_.graph();
  graph_.flush();
  measure_leverage();
  constexpr int kRounds = 8;  // by growing leverage: no list is kept to sort
  int dropped = 0;
  for (int round = 1; round <= kRounds && dropped < wanted; ++round) {
    const float most = 0.9F * static_cast<float>(round) / kRounds;
    for (int i = 0; i < g.factor_end() && dropped < wanted; ++i) {
      if (!(leverage_[i] < most)) continue;
      if (g.factor(i).state.active && !connected_without(i)) continue;
      leverage_[i] = 2.0F;
      graph_.retire_factor(i);
      ++dropped;
      ++factors_dropped_;
    }
  }
  return dropped;
}

template <class Space>
bool Condenser<Space>::make_room(int nodes, int factors) noexcept {
  const auto& g = graph_.graph();
  gone_count_ = 0;
  if (has_room(nodes, factors)) return true;
  const int slack = std::max(4, g.max_factors() / 16);
  if (g.factor_count() + factors + slack > g.max_factors()) {
    (void)thin_out(factors + 2 * slack);
    graph_.free_retired_factors();
  }
  const int wanted = g.node_count() + nodes - g.max_nodes();
  if (wanted <= 0) return has_room(nodes, factors);
  const bool room = g.factor_count() + factors <= g.max_factors();
  const int batch = std::max(wanted, g.max_nodes() / 64);
  for (int k = 0; k < batch && gone_count_ < static_cast<int>(gone_.size()); ++k) {
    const int node = least_informative();
    if (node < 0) break;
    contract(node);
  }
  return room && gone_count_ >= wanted;
}

template <class Space>
void Condenser<Space>::finish() noexcept {
  graph_.free_retired_factors();
  graph_.free_retired_nodes();
  gone_count_ = 0;
}

template class Condenser<PlanarSpace>;
template class Condenser<SpatialSpace>;

}  // namespace maplet
