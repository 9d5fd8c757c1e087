// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>

#include "core/geometry/se3.hpp"
#include "core/odometry/odometry_config.hpp"

namespace maplet {

/// Pose and velocity of the camera under the constant velocity model, with their covariance
/// relative to the newest keyframe. What the patches leave free keeps growing here.
///
/// Memory  inside the object.
/// Math    docs/math/odometry.md, eq. 9-11.
class MotionFilter {
 public:
  explicit MotionFilter(const OdometryConfig& config) noexcept;

  /// The camera is here; its velocity is unknown.
  void start(const Se3& T_odom_camera) noexcept;
  /// Moves on by dt_s >= 0; `damped` when nothing has been seen for a while.
  void predict(double dt_s, bool damped) noexcept;
  /// The time that passed is known only to this, one sigma.
  void blur(double sigma_s) noexcept;
  /// The pose is less certain by this (tangent of camera).
  void widen(const Matrix6d& covariance) noexcept { P_.topLeftCorner<6, 6>() += covariance; }
  /// A frame whose time makes no sense: the camera may have moved on by a frame, or not.
  void loosen() noexcept;
  /// Takes over an aligned pose whose free axes were filled from the prediction.
  /// @param information  of the measurement alone (tangent of camera); may be singular
  /// @param free_axes    its null space, unit tangents
  void update(const Se3& T_odom_camera, const Matrix6d& information,
              std::span<const Vector6d> free_axes) noexcept;
  /// Takes somebody else's word for where the camera is, as one measurement.
  /// @param information  tangent of camera; may be singular
  void fuse(const Se3& T_odom_camera, const Matrix6d& information) noexcept;
  /// Squared Mahalanobis distance of a pose from the present one, and its degrees of freedom.
  struct Distance {
    double chi2;
    int dof;
  };
  [[nodiscard]] Distance distance(const Se3& T_odom_camera,
                                  const Matrix6d& information) const noexcept;
  /// The same camera, moving as it does, in another place: what was believed of it was wrong.
  void jump(const Se3& T_odom_camera) noexcept { T_odom_camera_ = T_odom_camera; }
  /// The present pose becomes the reference: its covariance is zero from here on.
  void anchor() noexcept;

  [[nodiscard]] const Se3& pose() const noexcept { return T_odom_camera_; }
  [[nodiscard]] const Vector6d& velocity() const noexcept { return velocity_; }
  [[nodiscard]] Matrix6d covariance() const noexcept { return P_.topLeftCorner<6, 6>(); }

 private:
  void decouple(std::span<const Vector6d> free_axes) noexcept;

  Vector6d acceleration_;  ///< expected size
  Vector6d fastest_;       ///< no camera moves faster
  Se3 T_odom_camera_;
  Vector6d velocity_ = Vector6d::Zero();  ///< m/s, rad/s; tangent of camera
  Eigen::Matrix<double, 12, 12> P_ = Eigen::Matrix<double, 12, 12>::Zero();
};

}  // namespace maplet
