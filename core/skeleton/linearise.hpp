// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

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

/// What an elimination of everything is made of: the graph as it stands, or a relaxation of it that
/// is linear, whatever the estimate: rotations first, then positions given them.
enum class Model : std::uint8_t { kExact, kRotations, kPositions };

/// How much a factor says about each of its axes' rotation or position, on the average.
template <class Space>
[[nodiscard]] double mean_information(const Factor<Space>& f, Model model) noexcept {
  double sum = 0.0;
  const bool turn = model == Model::kRotations;
  const int first = turn ? Space::kPoint : 0;
  const int end = turn ? Space::kDim : Space::kPoint;
  for (int r = first; r < end; ++r) sum += f.information[r * (r + 1) / 2 + r];
  return f.weight * sum / (end - first);
}

/// A factor's share of a relaxation's Hessian, by the first kPoint rows of its nodes' blocks.
/// Math   docs/math/skeleton.md, eq. 29, 30.
template <class Space>
[[nodiscard]] HessianBlocks<Space> relaxed_hessian(const Factor<Space>& f, Model model) noexcept {
  constexpr int kPoint = Space::kPoint;
  const double information = mean_information(f, model);
  HessianBlocks<Space> h;
  h.aa.setZero();
  h.aa.template topLeftCorner<kPoint, kPoint>().diagonal().setConstant(information);
  h.bb = h.aa;
  h.ba = -h.aa;
  if (model == Model::kRotations)
    h.ba.template topLeftCorner<kPoint, kPoint>() =
        -information * measure::rotation(f.z).transpose();
  return h;
}

}  // namespace maplet
