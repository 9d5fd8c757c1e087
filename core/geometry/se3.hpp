// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace maplet {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// [v]_x, so that skew(v) * w = v x w.
[[nodiscard]] Eigen::Matrix3d skew(const Eigen::Vector3d& v) noexcept;

/// A rigid transform without named frames: p' = R p + t. Algorithms on many frames use it; public
/// interfaces use Transform<A, B>.
///
/// Math   docs/frames.md. Tangent xi = [rho; theta] (m, rad), right perturbation: T * exp(xi).
struct Se3 {
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();

  [[nodiscard]] static Se3 exp(const Vector6d& xi) noexcept;
  [[nodiscard]] Vector6d log() const noexcept;
  [[nodiscard]] Se3 inverse() const noexcept;
  /// Ad with T exp(xi) T^-1 = exp(Ad xi).
  [[nodiscard]] Matrix6d adjoint() const noexcept;
  [[nodiscard]] Eigen::Matrix3d rotation() const noexcept { return q.toRotationMatrix(); }
  /// Angle of the rotation, rad, in [0, pi].
  [[nodiscard]] double angle() const noexcept;
};

[[nodiscard]] Se3 operator*(const Se3& a, const Se3& b) noexcept;
[[nodiscard]] Eigen::Vector3d operator*(const Se3& a, const Eigen::Vector3d& p) noexcept;

/// Right Jacobian of SE(3) and its inverse: log(exp(xi) exp(d)) = xi + Jr^-1(xi) d + O(d^2).
[[nodiscard]] Matrix6d right_jacobian_inverse(const Vector6d& xi) noexcept;

// Frames, as types. See docs/frames.md.
struct WorldFrame;     ///< the skeleton's gauge
struct OdomFrame;      ///< continuous: never jumps; the first tracked camera
struct CameraFrame;    ///< depth camera now: z forward, x right, y down
struct KeyframeFrame;  ///< depth camera at a keyframe
struct MapletFrame;    ///< depth camera at a maplet's origin keyframe
struct BodyFrame;      ///< the robot's body

/// T_a_b: maps b into a, p_a = T_a_b * p_b. A mismatched composition does not compile.
template <class A, class B>
struct Transform {
  Se3 se3;

  Transform() = default;
  explicit Transform(const Se3& value) noexcept : se3{value} {}

  [[nodiscard]] Transform<B, A> inverse() const noexcept { return Transform<B, A>{se3.inverse()}; }
  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& p) const noexcept {
    return se3 * p;
  }
};

template <class A, class B, class C>
[[nodiscard]] Transform<A, C> operator*(const Transform<A, B>& a_b,
                                        const Transform<B, C>& b_c) noexcept {
  return Transform<A, C>{a_b.se3 * b_c.se3};
}

}  // namespace maplet
