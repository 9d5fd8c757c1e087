// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/skeleton/block_kernels.hpp"
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
[[nodiscard, gnu::always_inline]] inline typename Space::Tangent weigh(
    const Factor<Space>& f, const typename Space::Tangent& e) noexcept {
  typename Space::Tangent out = Space::Tangent::Zero();
#pragma GCC unroll 6
  for (int r = 0; r < Space::kDim; ++r) {
    const int row = r * (r + 1) / 2;
#pragma GCC unroll 6
    for (int c = 0; c < r; ++c) {
      out[r] += f.information[row + c] * e[c];
      out[c] += f.information[row + c] * e[r];
    }
    out[r] += f.information[row + r] * e[r];
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
  if constexpr (Space::kDim == 6) {  // with the elimination's kernels: c += a b^T
    typename Space::Block wa = Space::Block::Zero();
    typename Space::Block wb = Space::Block::Zero();
    h.aa.setZero();
    h.ba.setZero();
    h.bb.setZero();
    by_a.transposeInPlace();
    by_b.transposeInPlace();
    block::add_product<6>(wa.data(), by_a.data(), info.data());
    block::add_product<6>(wb.data(), by_b.data(), info.data());
    block::add_product<6>(h.aa.data(), wa.data(), by_a.data());
    block::add_product<6>(h.ba.data(), wb.data(), by_a.data());
    block::add_product<6>(h.bb.data(), wb.data(), by_b.data());
  } else {
    const typename Space::Block wa = info * by_a;
    const typename Space::Block wb = info * by_b;
    h.aa.noalias() = by_a.transpose() * wa;
    h.ba.noalias() = by_b.transpose() * wa;
    h.bb.noalias() = by_b.transpose() * wb;
  }
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
