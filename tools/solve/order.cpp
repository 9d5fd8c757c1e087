// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/solve/order.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <tuple>

#include "tools/solve/convert.hpp"

namespace maplet::graphs {
namespace {

/// What a double's sixteen digits still tell apart in one graph.
constexpr double kFarthest_m = 1e15;
constexpr double kSharpest = 1e24;

bool positive(const Edge& e, bool planar) {
  const auto rows = [&](int first, int count) {
    const Eigen::MatrixXd block = e.information.block(first, first, count, count);
    return Eigen::LLT<Eigen::MatrixXd>{block}.info() == Eigen::Success;
  };
  switch (e.kind) {
    case FactorKind::kRange:
      return rows(0, 1);
    case FactorKind::kBearing:
      return rows(1, planar ? 1 : 3);
    case FactorKind::kRangeBearing:
      return rows(0, planar ? 2 : 4);
    case FactorKind::kPosition:
      return rows(0, planar ? 2 : 3);
    default:
      if (!planar) return rows(0, 6);
      return Eigen::LLT<Eigen::Matrix3d>{information(e, PlanarSpace{})}.info() == Eigen::Success;
  }
}

/// @return why an edge cannot be used, or nullptr
const char* fault(const Edge& e, const GraphFile& graph) {
  const bool prior = e.kind == FactorKind::kPrior;
  if (!prior && e.a == e.b) return "it leads from a pose to itself";
  if (graph.points.contains(e.a) || (!measure::is_sight(e.kind) && graph.points.contains(e.b)))
    return "a pose is wanted where it names a point";
  if (!e.information.allFinite()) return "its information is not finite";
  if (!positive(e, graph.planar)) return "its information is not positive definite";
  if (e.information.cwiseAbs().maxCoeff() > kSharpest) return "its information is beyond 1e24";
  if (!(e.z.t.cwiseAbs().maxCoeff() < kFarthest_m) || !(e.range_m < kFarthest_m))
    return "it is longer than 1e15 m";
  return nullptr;
}

}  // namespace

bool is_odometry(const Edge& e) {
  return e.kind == FactorKind::kBetween && (e.a > e.b ? e.a - e.b == 1 : e.b - e.a == 1);
}

Order in_time_order(const GraphFile& graph) {
  Order order;
  std::set<std::uint64_t> seen;
  const auto moment = [&](std::uint64_t id) -> std::int64_t {
    if (graph.points.contains(id)) return -1;  // it has been there before
    const auto stamp = graph.stamps_s.find(id);
    if (stamp != graph.stamps_s.end()) return static_cast<std::int64_t>(stamp->second * 1e6);
    return static_cast<std::int64_t>(id & ((std::uint64_t{1} << 56) - 1));
  };
  for (int i = 0; i < static_cast<int>(graph.edges.size()); ++i) {
    const Edge& e = graph.edges[i];
    if (const char* why = fault(e, graph)) {
      if (++order.bad_edges <= Order::kMostNamed) order.named.push_back({i, why});
      continue;
    }
    seen.insert({e.a, e.b});
    const std::pair a{moment(e.a), e.a};
    const std::pair b{moment(e.b), e.b};
    const bool a_later = graph.points.contains(e.b) || a > b;
    order.items.push_back({(a_later ? a : b).first, a_later ? e.a : e.b, i});
  }
  order.nodes = seen.size();
  const auto rank = [&](const Item& item) {
    const Edge& e = graph.edges[item.edge];
    const std::uint64_t apart = e.a > e.b ? e.a - e.b : e.b - e.a;
    return std::tuple{item.moment, item.newest, measure::is_sight(e.kind),
                      measure::is_sight(e.kind) ? 0 : apart};
  };
  std::stable_sort(order.items.begin(), order.items.end(),
                   [&](const Item& x, const Item& y) { return rank(x) < rank(y); });
  return order;
}

}  // namespace maplet::graphs
