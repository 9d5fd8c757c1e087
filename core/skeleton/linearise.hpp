// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/skeleton/graph.hpp"
#include "core/skeleton/measure.hpp"

namespace maplet {

/// A factor's share of the Gauss-Newton Hessian: weight * J^T information J, block by block.
template <class Space>
struct HessianBlocks {
  typename Space::Block aa, ba, bb;
};

/// T_a_b of a factor's nodes now (a prior: T_world_a).
template <class Space>
[[nodiscard]] typename Space::Pose relative_pose(const Graph<Space>& graph,
                                                 const Factor<Space>& f) noexcept {
  if (f.kind == FactorKind::kPrior) return graph.node(f.a).pose;
  return Space::between(graph.node(f.a).pose, graph.node(f.b).pose);
}

/// information * e.
template <class Space>
[[nodiscard]] typename Space::Tangent weigh(const Factor<Space>& f,
                                            const typename Space::Tangent& e) noexcept {
  typename Space::Tangent out = Space::Tangent::Zero();
  int k = 0;
  for (int r = 0; r < Space::kDim; ++r) {
    for (int c = 0; c < r; ++c, ++k) {
      out[r] += f.information[k] * e[c];
      out[c] += f.information[k] * e[r];
    }
    out[r] += f.information[k++] * e[r];
  }
  return out;
}

/// Math   docs/math/skeleton.md, eq. 6, at a given relative pose.
template <class Space>
[[nodiscard]] HessianBlocks<Space> hessian(const Factor<Space>& f, const typename Space::Pose& rel,
                                           double weight) noexcept {
  typename Space::Block by_a, by_b;
  const typename Space::Tangent e = measure::error(f, rel);
  measure::jacobians(f, rel, e, by_a, by_b);
  typename Space::Block info = unpack<Space>(f.information);
  info *= weight;
  HessianBlocks<Space> h;
  if (f.kind == FactorKind::kPrior) {  // rel is a's own pose: it moves as b does
    h.aa.noalias() = by_b.transpose() * (info * by_b).eval();
    return h;
  }
  const typename Space::Block wa = info * by_a;
  const typename Space::Block wb = info * by_b;
  h.aa.noalias() = by_a.transpose() * wa;
  h.ba.noalias() = by_b.transpose() * wa;
  h.bb.noalias() = by_b.transpose() * wb;
  return h;
}

}  // namespace maplet
