// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/cut_rule.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {
constexpr double kChord_m = 0.1;  // shorter steps say nothing about the path's direction
}

void CutRule::start(const Se3& T_odom_origin) noexcept {
  const MapletConfig config = config_;
  *this = CutRule{config};
  origin_ = T_odom_origin;
  at_ = corner_ = T_odom_origin.t;
}

double CutRule::bend(const Eigen::Vector3d& step) const noexcept {
  if (step.norm() < kChord_m || heading_.isZero()) return 0.0;
  return std::acos(std::clamp(heading_.dot(step.normalized()), -1.0, 1.0));
}

CutReason CutRule::check(const Se3& T) const noexcept {
  if (curvature_rad_ + bend(T.t - corner_) > config_.max_curvature_rad) {
    return CutReason::kCurvature;
  }
  const Eigen::Vector3d forward = T.q * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d forward0 = origin_.q * Eigen::Vector3d::UnitZ();
  if (std::acos(std::clamp(forward.dot(forward0), -1.0, 1.0)) > config_.max_yaw_rad) {
    return CutReason::kYaw;
  }
  return path_m_ + (T.t - at_).norm() > config_.max_path_m ? CutReason::kPath : CutReason::kNone;
}

void CutRule::go(const Se3& T) noexcept {
  path_m_ += (T.t - at_).norm();
  at_ = T.t;
  const Eigen::Vector3d chord = T.t - corner_;
  if (chord.norm() < kChord_m) return;
  curvature_rad_ += bend(chord);
  heading_ = chord.normalized();
  corner_ = T.t;
}

}  // namespace maplet
