// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/fused_plane.hpp"

#include <Eigen/LU>
#include <cmath>
#include <limits>

namespace maplet {

namespace {

// Real surfaces are neither flat nor seen without distortion: what two sightings of one surface
// may differ by although both are precise.
constexpr double kUneven_m = 0.006;
constexpr double kUneven_rad = 0.02;
constexpr double kStudentNu = 5.0;

constexpr double kMostScatter = 300.0;  // of one sighting: beyond it is another surface
constexpr double kScatterPrior = 3.0;   // degrees of freedom that are as predicted
constexpr double kIndependent = 3.0;    // sightings, of any number

Eigen::Matrix3d uneven() noexcept {
  return Eigen::Vector3d{kUneven_rad * kUneven_rad, kUneven_rad * kUneven_rad,
                         kUneven_m * kUneven_m}
      .asDiagonal();
}

}  // namespace

void FusedPlane::start(const PlaneSighting& first, std::uint32_t serial_number,
                       std::uint32_t keyframe) noexcept {
  *this = {};
  serial = serial_number;
  last_keyframe = keyframe;
  observations = 1;
  plane = first.plane;
  tangent = first.tangent;
  information = first.covariance.inverse();
  axis = PlaneBasis::best_axis(plane.n);
  anchor = PlaneBasis{plane, axis};
  if (first.mean_gray >= 0.0F) {
    gray_sum = first.mean_gray * first.area_m2;
    gray_area_m2 = first.area_m2;
  }
}

double FusedPlane::distance(const PlaneSighting& sighting, double gate_m,
                            double gate_rad) const noexcept {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  if (sighting.plane.n.dot(plane.n) < std::cos(gate_rad)) return kFar;
  if (std::abs(plane.distance(sighting.tangent.centre)) > gate_m) return kFar;
  const Eigen::Matrix3d change = tangent.change_to(sighting.tangent);
  const Eigen::Matrix3d sum =
      change * covariance() * change.transpose() + sighting.covariance + uneven();
  const Eigen::Vector3d delta = sighting.tangent.of(plane);
  return delta.dot(sum.inverse() * delta);
}

Eigen::Matrix3d FusedPlane::honest_covariance() const noexcept {
  const double scale = (kScatterPrior + scatter) / (kScatterPrior + scattered);
  if (scale <= 1.0) return covariance();
  const double shared = std::max(1.0, observations / kIndependent);
  return scale * (1.0 + (shared - 1.0) * std::min(1.0, scale - 1.0)) * covariance();
}

void FusedPlane::fuse(const PlaneSighting& sighting, std::uint32_t keyframe) noexcept {
  const Eigen::Matrix3d change = sighting.tangent.change_to(tangent);
  const Eigen::Matrix3d measured = change * sighting.covariance * change.transpose();
  const Eigen::Vector3d delta = tangent.of(sighting.plane);
  const double chi2 = delta.dot((measured + covariance() + uneven()).inverse() * delta);
  scatter += std::min(kMostScatter, delta.dot((measured + covariance()).inverse() * delta));
  scattered += 3;
  const double weight = (kStudentNu + 3.0) / (kStudentNu + chi2);  // eq. 4
  const Eigen::Matrix3d gain = std::min(weight, 1.0) * measured.inverse();
  information += gain;
  const Plane moved = tangent.at(information.inverse() * (gain * delta));  // eq. 5
  tangent.centre -= moved.distance(tangent.centre) * moved.n;
  tangent.n = moved.n;
  tangent.u = (tangent.u - moved.n * moved.n.dot(tangent.u)).normalized();
  tangent.v = moved.n.cross(tangent.u);
  plane = moved;
  if (keyframe != last_keyframe) ++observations;
  last_keyframe = keyframe;
  if (sighting.mean_gray >= 0.0F) {
    gray_sum += sighting.mean_gray * sighting.area_m2;
    gray_area_m2 += sighting.area_m2;
  }
}

}  // namespace maplet
