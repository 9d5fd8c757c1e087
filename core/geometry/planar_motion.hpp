// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/geometry/se3.hpp"

namespace maplet {

/// The plane across some direction `up` of a camera's frame in 4 bytes, so that whoever holds them
/// holds the same plane.
enum class PlaneCode : std::uint32_t {
  kSpace = 0,  ///< no plane: motion in space
};

/// Motion of a camera on a vehicle that drives on a floor: a shift across `up` and a turn about it.
/// Such motions are a group, so poses in the first camera's frame, keyframes in a maplet and
/// delta-poses between maplets are all of this kind (paper: the 3x1 delta-pose).
///
/// The plane has axes of its own: right (the camera's x, across up), down (against up), forward
/// (right x down). Those of a level camera are the camera's.
///
/// Memory   a value.
/// Math     docs/math/icap.md, eq. 20-22.
class PlanarMotion {
 public:
  using Basis = Eigen::Matrix<double, 6, 3>;

  /// What estimates in the plane are held to: standard deviations out of it, m and rad.
  static constexpr double kFlat = 0x1p-10;
  /// What others are told: floor and `up` are off by that over a maplet's way. Up is found in one
  /// view to some milliradians. A sigma that records hold exactly.
  static constexpr double kTold = 0x1p-8;

  /// @param up  unit, camera's frame; rounded to what a code holds
  explicit PlanarMotion(const Eigen::Vector3d& up) noexcept;
  /// @param code  valid(), not kSpace
  explicit PlanarMotion(PlaneCode code) noexcept;

  [[nodiscard]] const Eigen::Vector3d& up() const noexcept { return up_; }
  [[nodiscard]] PlaneCode code() const noexcept { return code_; }
  /// Tangents [rho; theta] of motions in the plane, orthonormal: right, forward, a turn about down.
  [[nodiscard]] const Basis& basis() const noexcept { return basis_; }

  /// The turn about `up` and the shift across it that a transform contains.
  [[nodiscard]] Se3 project(const Se3& T) const noexcept;
  /// What a motion in the plane moves to the right and forward (m) and turns about down (rad).
  [[nodiscard]] Eigen::Vector3d coordinates(const Se3& T) const noexcept;
  [[nodiscard]] Se3 at(const Eigen::Vector3d& coordinates) const noexcept;
  /// The likeliest motion in the plane, given T with a covariance (m^2, rad^2; tangent of its right
  /// frame): what is out of the plane tells about what is in it.
  /// What is out of it by more than chance (kChance) widens what is said of within.
  /// @return with the covariance in the plane, and kFlat out of it
  static constexpr double kChance = 16.27;  ///< chi-square, 3 degrees of freedom, 0.999
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
  /// The same for others to read: kTold out of the plane.
  [[nodiscard]] Matrix6d told(const Matrix6d& covariance) const noexcept {
    return widen(basis_.transpose() * covariance * basis_, kTold);
  }
  /// A covariance of 3 numbers in the plane as one of 6.
  /// @param out  standard deviation out of the plane, m and rad
  [[nodiscard]] Matrix6d widen(const Eigen::Matrix3d& in_plane, double out = kFlat) const noexcept;

 private:
  Eigen::Vector3d up_;
  PlaneCode code_;
  Basis basis_;
  Matrix6d out_of_plane_;  ///< projector: rho along up, theta across it
};

/// False when no PlanarMotion has that code; kSpace is valid.
[[nodiscard]] bool valid(PlaneCode code) noexcept;

}  // namespace maplet
