// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/geometry/se3.hpp"
#include "core/odometry/patch_view.hpp"
#include "core/odometry/pose_information.hpp"
#include "core/odometry/sym3.hpp"

namespace maplet {

/// A patch of the frame and the one of a keyframe that it lies on.
struct FacetPair {
  const Facet* frame;
  const Facet* reference;
  Sym3 weight;  ///< inverse covariance of the residual
};

/// Of T_camera_reference, right-perturbed on the camera's side.
struct PlaneMotion {
  Eigen::Matrix3d R;
  Eigen::Vector3d p;

  explicit PlaneMotion(const Se3& T_reference_camera) noexcept
      : R{T_reference_camera.rotation().transpose()}, p{-(R * T_reference_camera.t)} {}

  /// Eq. 1
  [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& theta) const noexcept {
    const Eigen::Vector3d q = times(R, theta);
    return q * (1.0 / (1.0 + dot(q, p)));
  }
};

struct NormalEquations {
  Matrix6d information = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();

  void operator+=(const NormalEquations& other) noexcept {
    information += other.information;
    gradient += other.gradient;
  }
};

/// What is known to stand still, and what may not.
struct PairEvidence {
  NormalEquations known;
  NormalEquations fresh;

  void operator+=(const PairEvidence& other) noexcept {
    known += other.known;
    fresh += other.fresh;
  }
  [[nodiscard]] NormalEquations whole(double trust) const noexcept {
    return {known.information + trust * fresh.information, known.gradient + trust * fresh.gradient};
  }
  /// Squared distance of what the fresh pairs ask for from where the known ones and the prior lead,
  /// per degree of freedom and over what both let expect.
  ///
  /// @param prior  what is known without looking
  /// Math  docs/math/odometry.md, eq. 22
  [[nodiscard]] double disagreement(const NormalEquations& prior) const noexcept;
};

/// Normal equations of the pairs (tangent of camera).
///
/// Math  docs/math/odometry.md, eq. 4-5
[[nodiscard]] PairEvidence evidence_of(std::span<const FacetPair> pairs,
                                       const PlaneMotion& motion) noexcept;

/// The information that noise of the references' normals makes up. Looks at every fourth pair.
///
/// @param trust  weight of fresh pairs
/// Math  docs/math/odometry.md, eq. 7
[[nodiscard]] Matrix6d spurious_information(std::span<const FacetPair> pairs,
                                            const PlaneMotion& motion, double trust) noexcept;

/// What the pairs of one reference say of a pose that was found.
struct PairVerdict {
  double pixels = 0.0;  ///< of the frame, on inliers
  double chi2 = 0.0;    ///< of inliers
  std::uint32_t inliers = 0;
};

/// @param trust   weight of fresh pairs
/// @param blocks  takes the pairs' scores; may be null
[[nodiscard]] PairVerdict judge_pairs(std::span<const FacetPair> pairs, const PlaneMotion& motion,
                                      double trust, ScoreBlocks* blocks) noexcept;

}  // namespace maplet
