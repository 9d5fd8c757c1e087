// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <span>

#include "core/geometry/planar_motion.hpp"
#include "core/geometry/se3.hpp"
#include "core/registration/plane_pairs.hpp"

namespace maplet {

/// eq. 5: where b's plane lies about a's, under T.
[[nodiscard]] Eigen::Vector3d residual(const PlanePair& pair, const Se3& T) noexcept;

/// Student's, for three numbers.
[[nodiscard]] inline double robust_weight(double chi2) noexcept {
  constexpr double kNu = 5.0;
  return std::min(1.0, (kNu + 3.0) / (kNu + chi2));
}

/// How large residuals are beside what covariances say: the middle one's chi2, kLeast..1. What is
/// far off the others counts less, also where all of them are better than expected. eq. 6a
///
/// Time   O(pairs)
[[nodiscard]] double spread_of(std::span<const PlanePair> pairs, const Se3& T) noexcept;

/// What pairs of planes say about a step xi in T exp(xi), all together.
///
/// Math   docs/math/icap.md, eq. 5-9
struct PairSums {
  Matrix6d information = Matrix6d::Zero();
  Matrix6d spurious = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();  ///< among the pairs, b's frame
  double chi2 = 0.0;                                ///< beside what covariances say
  double squares_m2 = 0.0;

  [[nodiscard]] static PairSums of(std::span<const PlanePair> pairs, const Se3& T) noexcept;
  /// What is out of the plane of motion is known, eq. 22.
  void restrict_to(const PlanarMotion& planar) noexcept;
};

/// What single pairs move: the sum over all pairs of s s^T, s the step that the others would make
/// if it were not there. Pairs that agree move nothing; a wrong one, or one that an axis rests on
/// alone, does. Tangent of b.
///
/// Time   O(pairs)
/// Math   docs/math/icap.md, eq. 11e
[[nodiscard]] Matrix6d leave_one_out(std::span<const PlanePair> pairs, const Se3& T,
                                     double free_sigma_m) noexcept;

/// chi2 per degree of freedom, each pair counted by its leverage: how much of the answer rests on
/// it. A pair that the answer follows has a small residual for that alone, which is undone.
/// @param covariance  inverse of the pairs' information, zero along free axes; tangent of b
///
/// Math   docs/math/icap.md, eq. 11a
[[nodiscard]] double leverage_chi2(std::span<const PlanePair> pairs, const Se3& T,
                                   const Matrix6d& covariance) noexcept;

}  // namespace maplet
