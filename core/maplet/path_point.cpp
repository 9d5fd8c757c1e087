// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/path_point.hpp"

#include <cmath>

namespace maplet {

namespace {
constexpr double kNowhere_m = 1e-6;  // from the origin: at it
}

CarriedRange carry_to_origin(const PathPoint& at, const RangeMeasurement& measured) noexcept {
  const Se3& T = at.T_maplet_camera.se3;
  const double moved_m = T.t.norm();
  const double r = measured.range_m;
  CarriedRange out{at.maplet, r, measured.sigma_m};
  if (moved_m < kNowhere_m) return out;
  double variance = measured.sigma_m * measured.sigma_m;
  if (measured.bearing.isZero()) {
    // |t + r e| over all directions e: its mean and variance to second order in |t| / r.
    const double far = std::max(r, moved_m);
    out.range_m = far + std::pow(std::min(r, moved_m), 2) / (3.0 * far);
    variance += std::pow(std::min(r, moved_m), 2) / 3.0;
    variance += at.covariance.topLeftCorner<3, 3>().trace() / 3.0;
    out.sigma_m = std::sqrt(variance);
    return out;
  }
  const Eigen::Vector3d there = T * Eigen::Vector3d{r * measured.bearing};
  out.range_m = there.norm();
  const Eigen::Vector3d toward = T.q.conjugate() * (there / std::max(out.range_m, kNowhere_m));
  const double along = toward.dot(measured.bearing);
  const double across = std::sqrt(std::max(0.0, 1.0 - along * along));
  Eigen::Matrix<double, 1, 6> by_pose;  // right perturbation of T
  by_pose << toward.transpose(), (r * measured.bearing.cross(toward)).transpose();
  variance = along * along * variance + (by_pose * at.covariance * by_pose.transpose())(0, 0);
  variance += std::pow(r * across * measured.bearing_sigma_rad, 2);
  out.sigma_m = std::sqrt(variance);
  return out;
}

}  // namespace maplet
