// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "tools/solve/convert.hpp"
#include "tools/solve/node_table.hpp"
#include "tools/solve/run.hpp"

namespace maplet::graphs {

/// g2o's error: the quaternion's vector part in place of the logarithm.
inline double chi2_g2o(const Factor<PlanarSpace>& f) { return f.chi2; }
inline double chi2_g2o(const Factor<SpatialSpace>& f) {
  if (measure::is_sight(f.kind)) return f.chi2;
  Vector6d e;
  const Se3 d = Se3::exp(f.e);
  const double sign = d.q.w() < 0.0 ? -1.0 : 1.0;
  e << d.t, sign * d.q.vec();
  return e.dot(unpack<SpatialSpace>(f.information) * e);
}

/// Vertices that no edge names stay where their file has them, each a group of its own.
inline void add_lone_vertices(const GraphFile& file, SolveOutcome& outcome) {
  std::set<std::uint64_t> there;
  for (const Vertex& v : outcome.solution.vertices) there.insert(v.id);
  for (const Vertex& v : file.vertices) {
    if (!there.insert(v.id).second) continue;
    outcome.solution.vertices.push_back(v);
    ++outcome.groups;
  }
}

/// What the graph has come to.
template <class Space>
void give_solution(const PoseGraph<Space>& solver, const NodeTable<Space>& table,
                   const GraphFile& file, SolveOutcome& outcome) {
  const Graph<Space>& graph = solver.graph();
  GraphFile& out = outcome.solution;
  out.planar = file.planar;
  out.points = file.points;
  table.for_each([&](std::uint64_t id, int n) {
    out.vertices.push_back({id, from_pose(graph.node(n).pose)});
    outcome.groups += graph.node(n).group == n ? 1 : 0;
    if (const auto t = file.stamps_s.find(id); t != file.stamps_s.end()) out.stamps_s.insert(*t);
  });
  if (!table.limited()) add_lone_vertices(file, outcome);
  if (outcome.contracted == 0 && outcome.dropped_factors == 0) {
    out.edges = file.edges;
  } else {  // what the factors have become
    for (int i = 0; i < graph.factor_end(); ++i) {
      const Factor<Space>& f = graph.factor(i);
      if (f.a == -1 || !f.state.active || f.kind != FactorKind::kBetween) continue;
      Edge e;
      e.a = table.id_of(f.a);
      e.b = table.id_of(f.b);
      e.z = from_pose(f.z);
      put_information(unpack<Space>(f.information), e);
      out.edges.push_back(e);
    }
  }
  outcome.accuracy = score(file, out.vertices);
}

template <class Space>
void tell(PoseGraph<Space>& solver, const NodeTable<Space>& table, const GraphFile& file,
          const std::vector<int>& edge_of, SolveOutcome& outcome) {
  (void)solver.chi2();
  const Graph<Space>& graph = solver.graph();
  for (int i = 0; i < graph.factor_end(); ++i) {
    const Factor<Space>& f = graph.factor(i);
    if (f.a == -1) continue;
    if (!f.state.active || f.weight < 0.5) {
      if (edge_of[i] >= 0) outcome.rejected.push_back(file.edges[edge_of[i]]);
      continue;
    }
    ++outcome.accepted;
    outcome.chi2 += chi2_g2o(f);
    outcome.f_log += 0.5 * f.chi2;
  }
  outcome.damped_pivots = solver.elimination().damped_pivots();
  outcome.overflows = solver.overflows();
  outcome.live_blocks = solver.elimination().pool().live();
  if (table.limited()) {
    outcome.contracted = table.condenser().nodes_gone();
    outcome.dropped_factors = table.condenser().factors_dropped();
  }
  give_solution(solver, table, file, outcome);
}

}  // namespace maplet::graphs
