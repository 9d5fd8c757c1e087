// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A keyframe's pose, refined against the planes that the maplet has so far.
#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/maplet/plane_map.hpp"
#include "core/maplet/plane_view.hpp"

namespace maplet {

namespace {

constexpr int kRounds = 4;
constexpr double kNu = 5.0;
constexpr double kEnough = 3.0;  // planes, below it the odometry stands
constexpr double kMost_m = 0.1;  // a larger correction is a wrong association
constexpr double kMost_rad = 0.08;

// An odometry without any doubt has no inverse covariance, and nothing to refine.
bool trusts_odometry(const MapletConfig& c) noexcept {
  return c.odometry_scale == 0.0 && (c.odometry_floor_m == 0.0 || c.odometry_floor_rad == 0.0);
}

}  // namespace

Se3 PlaneMap::refine(const PatchSet& set, const Se3& T_odometry,
                     const Matrix6d& covariance) noexcept {
  if (planes_.count == 0 || set.planes.empty() || trusts_odometry(config_)) return T_odometry;
  sort_patches(set);
  const double scale = config_.odometry_scale * config_.odometry_scale;
  Matrix6d step = scale * covariance;
  step.topLeftCorner<3, 3>().diagonal().array() +=
      config_.odometry_floor_m * config_.odometry_floor_m;
  step.bottomRightCorner<3, 3>().diagonal().array() +=
      config_.odometry_floor_rad * config_.odometry_floor_rad;
  const Matrix6d prior = step.inverse();
  Se3 T = T_odometry;
  for (int round = 0; round < kRounds; ++round) {
    const View view{set, T, T.inverse(), step, order_, first_of_};
    Matrix6d normal = prior;
    Vector6d right = -prior * (T_odometry.inverse() * T).log();
    double count = 0.0;
    for (std::size_t f = 0; f < set.planes.size(); ++f) {
      if (view.patches_of(f).empty()) continue;
      const PlaneSighting sighting = sight(view, f);
      const FusedPlane* plane = associate(view, sighting, f);
      if (plane == nullptr) continue;
      const Eigen::Vector3d r = sighting.tangent.of(plane->plane);
      const Eigen::Matrix3d change = plane->tangent.change_to(sighting.tangent);
      Eigen::Matrix3d spread = sighting.sensor + change * plane->covariance() * change.transpose();
      const double uneven_rad =
          std::min(0.02, 2.0 * config_.uneven_m / std::sqrt(std::max(1e-3, sighting.area_m2)));
      spread.diagonal() += Eigen::Vector3d{uneven_rad, uneven_rad, config_.uneven_m}.cwiseAbs2();
      Eigen::Matrix3d w = spread.inverse();
      w *= std::min(1.0, (kNu + 3.0) / (kNu + r.dot(w * r)));
      const Eigen::Matrix<double, 3, 6>& j = sighting.by_pose;
      normal += j.transpose() * w * j;
      right += j.transpose() * (w * r);
      count += 1.0;
    }
    if (count < kEnough) return T_odometry;
    const Vector6d xi = normal.ldlt().solve(right);  // eq. 8
    T = T * Se3::exp(xi);
    if (xi.head<3>().norm() < 2e-4 && xi.tail<3>().norm() < 1e-4) break;
  }
  const Se3 moved = T_odometry.inverse() * T;
  const bool sound = moved.t.norm() < kMost_m && moved.angle() < kMost_rad;
  return sound ? T : T_odometry;
}

}  // namespace maplet
