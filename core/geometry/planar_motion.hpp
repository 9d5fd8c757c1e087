// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/geometry/se3.hpp"

namespace maplet {

/// Motion of a camera on a vehicle that drives on a floor: a shift across `up` and a turn about it.
/// Such motions are a group, so poses in the first camera's frame, keyframes in a maplet and
/// delta-poses between maplets are all of this kind (paper: the 3x1 delta-pose).
///
/// Memory   a value.
/// Math     docs/math/icap.md, eq. 20-22.
class PlanarMotion {
 public:
  using Basis = Eigen::Matrix<double, 6, 3>;

  /// What a floor is off by: standard deviations out of the plane.
  static constexpr double kFlat = 0x1p-10;  ///< m and rad; a sigma that records hold exactly

  /// @param up  unit, camera's frame
  explicit PlanarMotion(const Eigen::Vector3d& up) noexcept;

  [[nodiscard]] const Eigen::Vector3d& up() const noexcept { return up_; }
  /// Tangents [rho; theta] of motions in the plane, orthonormal: two shifts, the turn.
  [[nodiscard]] const Basis& basis() const noexcept { return basis_; }

  /// The turn about `up` and the shift across it that a transform contains.
  [[nodiscard]] Se3 project(const Se3& T) const noexcept;
  /// The likeliest motion in the plane, given T with a covariance (m^2, rad^2; tangent of its right
  /// frame): what is out of the plane tells about what is in it.
  /// @return with the covariance in the plane, and kFlat out of it
  struct Conditioned {
    Se3 T;
    Matrix6d covariance;
  };
  [[nodiscard]] Conditioned condition(const Se3& T, const Matrix6d& covariance) const noexcept;
  /// The same of an information: in the plane as it is, out of it that of a floor.
  [[nodiscard]] Matrix6d restrict_information(const Matrix6d& information) const noexcept;
  /// A covariance whose part in the plane does not depend on the rest: that part, and a floor.
  [[nodiscard]] Matrix6d restrict_covariance(const Matrix6d& covariance) const noexcept {
    return widen(basis_.transpose() * covariance * basis_);
  }
  /// A covariance of 3 numbers in the plane as one of 6.
  [[nodiscard]] Matrix6d widen(const Eigen::Matrix3d& in_plane) const noexcept;

 private:
  Eigen::Vector3d up_;
  Basis basis_;
  Matrix6d out_of_plane_;  ///< projector: rho along up, theta across it
};

}  // namespace maplet
