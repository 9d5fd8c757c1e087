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

Matrix6d covariance_of(const Whereabouts& whereabouts, std::uint32_t segment) noexcept {
  if (segment == whereabouts.segment) return whereabouts.covariance;
  return whereabouts.covariance + whereabouts.gap;
}

// Whether a view counts, and the camera may be near it.
bool may_be(const Whereabouts& whereabouts, const StoredView& view) noexcept {
  const bool same = view.segment == whereabouts.segment;
  if (same ? !whereabouts.this_segment : !whereabouts.other_segments) return false;
  return within_reach(whereabouts.T_odom_camera.inverse() * view.T_odom_view,
                      covariance_of(whereabouts, view.segment));
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

// The keyframe within reach on which the most of the frame lies as it is; kNothing without one.
std::size_t Relocaliser::likeliest(const PatchView& frame, const KeyframePool& pool,
                                   const Whereabouts& whereabouts) const noexcept {
  std::size_t best = kNothing;
  double most = kScreen;
  for (std::size_t i = 0; i < pool.size(); ++i) {
    if (!may_be(whereabouts, {pool.place(i).T_odom_camera, pool.place(i).segment})) continue;
    const double share = frame.share_on(*pool.reference(i).view, Se3{});
    if (share < most) continue;
    best = i;
    most = share;
  }
  return best;
}

bool Relocaliser::run(const PatchView& frame, const KeyframePool& pool, PatchAligner& aligner,
                      PhotoTerm& no_photo, const Whereabouts& whereabouts, Deadline deadline,
                      Recognition& out) noexcept {
  const std::size_t all = pool.size() + (views_ == nullptr ? 0 : views_->count());
  const std::size_t first = likeliest(frame, pool, whereabouts);
  int tries = 0;
  int draws = 0;
  for (std::size_t i = 0; i <= all && tries < kTries && draws < kDraws; ++i) {
    if (i > 0) next_ = (next_ + 1) % all;
    if (i == 0 ? first == kNothing : next_ == first) continue;
    const std::size_t which = i == 0 ? first : next_;
    const bool stored = which >= pool.size();
    const std::size_t index = stored ? which - pool.size() : which;
    const StoredView at =
        stored ? views_->at(index)
               : StoredView{pool.place(index).T_odom_camera, pool.place(index).segment};
    if (!may_be(whereabouts, at)) continue;
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
    const Se3 off = whereabouts.T_odom_camera.inverse() * out.alignment.T_odom_camera;
    if (!within_gate(off, covariance_of(whereabouts, at.segment))) continue;
    out.segment = at.segment;
    out.stored = stored;
    return true;
  }
  return false;
}

}  // namespace maplet
