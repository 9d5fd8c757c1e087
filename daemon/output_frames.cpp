// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/output_frames.hpp"

#include "daemon/mounting.hpp"

namespace maplet::daemon {

namespace {

constexpr double kUpright = 1e-3;

/// The turn that takes `up` (unit, body's axes) to z and leaves x ahead.
Se3 levelled(const Eigen::Vector3d& up) noexcept {
  const Eigen::Vector3d ahead = Eigen::Vector3d::UnitX();
  Eigen::Vector3d x = ahead - ahead.dot(up) * up;
  if (x.norm() < kUpright) {
    return {Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ()),
            Eigen::Vector3d::Zero()};
  }
  x.normalize();
  Eigen::Matrix3d R;
  R.row(0) = x;
  R.row(1) = up.cross(x);
  R.row(2) = up;
  return {Eigen::Quaterniond{R}, Eigen::Vector3d::Zero()};
}

}  // namespace

OutputFrame output_frame_of(std::string_view name) noexcept {
  if (name == "ned_frd") return OutputFrame::kNedFrd;
  return name == "camera" ? OutputFrame::kCamera : OutputFrame::kEnuFlu;
}

OutputFrames::OutputFrames(const Se3& T_body_camera, const Vector3OrAuto& up) noexcept
    : T_body_camera_{T_body_camera}, up_{up}, T_out_odom_{T_body_camera} {
  T_map_world_ = T_out_odom_;
}

void OutputFrames::begin(const PatchSet& first_view) noexcept {
  if (begun_) return;
  begun_ = true;
  const Eigen::Vector3d up = first_up(first_view, mounting_of(T_body_camera_, up_)).up;
  T_out_odom_ = levelled(T_body_camera_.q * up) * T_body_camera_;
  T_map_world_ = T_out_odom_;
}

void OutputFrames::follow(const MapFrame::Notice& map) noexcept {
  if (map_known_ && map.map == map_) return;
  map_ = map.map;
  map_known_ = true;
  // Up as odometry knows it, seen in the world: where that is odometry's own, nothing changes.
  const Eigen::Vector3d up_odom = T_out_odom_.q.conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d up_world = map.T_map_odom.q * up_odom;
  T_map_world_ = levelled(T_body_camera_.q * up_world) * T_body_camera_;
}

OutsidePose OutputFrames::outside(const OutsidePose& inside) const noexcept {
  const Se3 T_camera_body = T_body_camera_.inverse();
  const Matrix6d Ad = T_body_camera_.adjoint();
  OutsidePose out;
  out.T_odom_base = T_out_odom_ * inside.T_odom_base * T_camera_body;
  out.T_odom_base.q.normalize();
  out.covariance = Ad * inside.covariance * Ad.transpose();
  out.twist = Ad * inside.twist;
  out.twist_covariance = Ad * inside.twist_covariance * Ad.transpose();
  out.T_map_odom = T_map_world_ * inside.T_map_odom * T_out_odom_.inverse();
  out.T_map_odom.q.normalize();
  return out;
}

OutsidePose to_ned_frd(const OutsidePose& in) noexcept {
  const Se3 C{Eigen::Quaterniond{0.0, 1.0, 0.0, 0.0}, Eigen::Vector3d::Zero()};  // half a turn, x
  const Matrix6d Ad = C.adjoint();
  OutsidePose out;
  out.T_odom_base = C * in.T_odom_base * C;
  out.covariance = Ad * in.covariance * Ad.transpose();
  out.twist = Ad * in.twist;
  out.twist_covariance = Ad * in.twist_covariance * Ad.transpose();
  out.T_map_odom = C * in.T_map_odom * C;
  return out;
}

}  // namespace maplet::daemon
