// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/skeleton/graph.hpp"

namespace maplet {

/// Ad(T^-1): carries a tangent across T.
template <class Space>
[[nodiscard]] typename Space::Block adjoint_of_inverse(const typename Space::Pose& T) noexcept {
  typename Space::Block minus, ignored;
  Space::jacobians(T, T, Space::Tangent::Zero(), minus, ignored);
  return -minus;
}

/// A relative pose T_a_b with its covariance, tangent of b.
///
/// Math   docs/math/skeleton.md, eq. 22-23.
template <class Space>
struct Relation {
  using Pose = typename Space::Pose;
  using Block = typename Space::Block;

  Pose T;
  Block covariance = Block::Zero();

  /// T_b_a.
  [[nodiscard]] Relation inverse() const noexcept {
    const Pose back = Space::between(T, Pose{});
    const Block ad = adjoint_of_inverse<Space>(back);
    return {back, ad * covariance * ad.transpose()};
  }
  /// T_a_c of T_a_b and T_b_c, whose errors are independent.
  [[nodiscard]] Relation then(const Relation& next) const noexcept {
    const Block ad = adjoint_of_inverse<Space>(next.T);
    return {Space::compose(T, next.T), next.covariance + ad * covariance * ad.transpose()};
  }
};

}  // namespace maplet
