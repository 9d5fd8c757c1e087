// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/relocaliser.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr double kReachM = 0.5;    // of a view, beyond what the camera's place is uncertain by
constexpr double kReachRad = 0.5;  // the same
constexpr double kSigmas = 3.0;
constexpr double kScreen = 0.2;        // of the frame's patches must lie on the view's as it is
constexpr double kFoundOverlap = 0.4;  // a view is recognised, not just tracked on
constexpr double kStartSlack = 0.1;    // m, rad
constexpr double kLoosePrior = 1.0;    // information, 1/m^2 and 1/rad^2
constexpr double kFloorM = 0.05;
constexpr double kFloorRad = 0.05;
constexpr double kGate = 32.0;  // chi-square of 6 degrees of freedom, 2e-5

double largest_sigma(const Eigen::Matrix3d& covariance) noexcept {
  return std::sqrt(std::max(0.0, covariance.diagonal().maxCoeff()));
}

bool within_reach(const Se3& T_camera_view, const Matrix6d& covariance) noexcept {
  return T_camera_view.t.norm() <
             kReachM + kSigmas * largest_sigma(covariance.topLeftCorner<3, 3>()) &&
         T_camera_view.angle() <
             kReachRad + kSigmas * largest_sigma(covariance.bottomRightCorner<3, 3>());
}

bool within_gate(const Se3& T_expected_found, Matrix6d covariance) noexcept {
  covariance.diagonal().head<3>().array() += kFloorM * kFloorM;
  covariance.diagonal().tail<3>().array() += kFloorRad * kFloorRad;
  const Vector6d off = T_expected_found.log();
  return off.dot(covariance.ldlt().solve(off)) < kGate;
}

}  // namespace

Relocaliser::Relocaliser(const OdometryConfig& config, Arena& arena)
    : config_{config},
      drawn_{arena.make<PatchSet>("odometry/drawn view")},
      drawn_view_{facets_of(config), arena} {}

bool Relocaliser::recognise(const PatchView& frame, const Reference& reference,
                            PatchAligner& aligner, PhotoTerm& no_photo, Deadline deadline,
                            Alignment& out) const noexcept {
  const Se3 T_odom_view = reference.T_reference_odom.inverse();
  const PosePrior prior{T_odom_view, kLoosePrior * Matrix6d::Identity()};
  out = aligner.run(frame, {&reference, 1}, prior, {T_odom_view, kStartSlack, kStartSlack},
                    no_photo, deadline);
  return usable(out, config_) && out.overlap > kFoundOverlap && out.free_axes.empty();
}

bool Relocaliser::run(const PatchView& frame, const KeyframePool& pool, PatchAligner& aligner,
                      PhotoTerm& no_photo, const Whereabouts& whereabouts, Deadline deadline,
                      Recognition& out) noexcept {
  const std::size_t all = pool.size() + (views_ == nullptr ? 0 : views_->count());
  const Se3 T_camera_odom = whereabouts.T_odom_camera.inverse();
  int tries = 0;
  int draws = 0;
  for (std::size_t i = 0; i < all && tries < kTries && draws < kDraws; ++i) {
    next_ = (next_ + 1) % all;
    const bool stored = next_ >= pool.size();
    const std::size_t index = stored ? next_ - pool.size() : next_;
    const StoredView at =
        stored ? views_->at(index)
               : StoredView{pool.place(index).T_odom_camera, pool.place(index).segment};
    const bool same = at.segment == whereabouts.segment;
    if (same ? !whereabouts.this_segment : !whereabouts.other_segments) continue;
    const Matrix6d covariance =
        same ? whereabouts.covariance : Matrix6d{whereabouts.covariance + whereabouts.gap};
    if (!within_reach(T_camera_odom * at.T_odom_view, covariance)) continue;
    if (tries + draws > 0 && deadline.expired()) return false;
    Reference reference{&drawn_view_, at.T_odom_view.inverse()};
    if (stored) {
      ++draws;
      if (!views_->draw(index, frame.camera(), *drawn_)) continue;
      drawn_view_.assign(*drawn_, config_);
    } else {
      reference = pool.reference(index);
    }
    if (frame.share_on(*reference.view, Se3{}) < kScreen) continue;
    ++tries;
    if (!recognise(frame, reference, aligner, no_photo, deadline, out.alignment)) continue;
    if (!within_gate(T_camera_odom * out.alignment.T_odom_camera, covariance)) continue;
    out.segment = at.segment;
    out.stored = stored;
    return true;
  }
  return false;
}

}  // namespace maplet
