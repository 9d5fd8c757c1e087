// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/registrar.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>

namespace maplet {

namespace {

constexpr double kContradiction = 35.0;  // chi-square, 6 degrees of freedom: beyond 0.99999
constexpr double kAstrayM = 0.5;

// Whether the way is unknown by more than that along some axis (a gap, a corridor): then planes are
// paired with others than their own, those of the next door.
bool astray(const Matrix6d& covariance) noexcept {
  return !(covariance.diagonal().head<3>().maxCoeff() < kAstrayM * kAstrayM);
}

}  // namespace

Registrar::Registrar(const RegistrationConfig& config, Arena& arena)
    : config_{config}, icap_{arena.make<Icap>("registration/icap", config)} {}

DeltaPose Registrar::link(const Maplet& previous, const Maplet& current, const PathLink& odometry,
                          Deadline deadline) noexcept {
  ++counts_.links;
  fit_ = std::numeric_limits<double>::quiet_NaN();
  DeltaPose out = fuse(previous, current, odometry, deadline);
  if (planar_) {
    out.T_a_b = Transform<MapletA, MapletB>{planar_->project(out.T_a_b.se3)};
    out.covariance = planar_->told(out.covariance);
    out.plane = planar_->code();
  }
  return out;
}

DeltaPose Registrar::fuse(const Maplet& previous, const Maplet& current, const PathLink& odometry,
                          Deadline deadline) noexcept {
  DeltaPose out;
  out.kind = DeltaPose::Kind::kConsecutive;
  out.a = previous.key;
  out.b = current.key;
  out.stamp_a = previous.stamp;
  out.stamp_b = current.stamp;
  out.T_a_b = Transform<MapletA, MapletB>{odometry.T_previous_this.se3};
  out.covariance = odometry.covariance;

  // Any three planes would seem to make up for it.
  if (loose(odometry.covariance) || astray(odometry.covariance)) {
    ++counts_.odometry_alone;
    return out;
  }
  const auto planes = icap_->align(previous, current, out.T_a_b, config_.link_gate_m,
                                   config_.link_gate_rad, deadline);
  if (!planes) {
    ++counts_.odometry_alone;
    return out;
  }
  if (planes->stop == Stop::kDeadline) ++counts_.deadline_misses;
  const Vector6d apart = (out.T_a_b.se3.inverse() * planes->T_a_b.se3).log();
  const Matrix6d together = planes->covariance + odometry.covariance;
  if (apart.dot(together.ldlt().solve(apart)) > kContradiction) {
    ++counts_.contradicted;
    return out;
  }
  if (!planes->free_axes.empty()) ++counts_.with_free_axes;
  const FusedTransform fused =
      intersect(out.T_a_b.se3, odometry.covariance, planes->T_a_b.se3, planes->information);
  out.T_a_b = Transform<MapletA, MapletB>{fused.T};
  out.covariance = fused.covariance;
  fit_ = planes->chi2_per_dof;
  out.overlap = static_cast<float>(planes->overlap);
  out.matches = planes->matches;
  return out;
}

FusedTransform intersect(const Se3& x, const Matrix6d& covariance_x, const Se3& y,
                         const Matrix6d& information_y) noexcept {
  const Matrix6d information_x = covariance_x.inverse();
  double best_weight = 0.0;
  double best_volume = information_x.determinant();
  for (int i = 1; i < 20; ++i) {  // eq. 13; the determinant is smooth: twenty steps will do
    const double weight = 0.05 * i;
    const double volume = ((1.0 - weight) * information_x + weight * information_y).determinant();
    if (volume <= best_volume) continue;
    best_volume = volume;
    best_weight = weight;
  }
  FusedTransform out;
  out.weight_y = best_weight;
  const Matrix6d sum = (1.0 - best_weight) * information_x + best_weight * information_y;
  out.covariance = sum.inverse();
  const Vector6d apart = (x.inverse() * y).log();
  // One Gauss-Newton step from x; information_y is in y's tangent, near enough for such steps.
  out.T = x * Se3::exp(out.covariance * (best_weight * information_y * apart));
  return out;
}

}  // namespace maplet
