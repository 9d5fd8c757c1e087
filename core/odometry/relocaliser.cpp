// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/relocaliser.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/odometry/telling.hpp"

namespace maplet {

namespace {

constexpr double kReachM = 0.5;    // of a view, beyond what the camera's place is uncertain by
constexpr double kReachRad = 0.5;  // the same
constexpr double kSigmas = 3.0;
constexpr double kScreen = 0.2;      // of the frame's patches must lie on the view's as it is
constexpr double kStartSlack = 0.1;  // m, rad
constexpr double kLoosePrior = 1.0;  // information, 1/m^2 and 1/rad^2
constexpr double kFloorM = 0.05;
constexpr double kFloorRad = 0.05;
constexpr double kSlideM = 0.25;
constexpr double kGate = 32.0;  // chi-square of 6 degrees of freedom, 2e-5

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
  if (!recognised(out, config_)) return false;
  // What slid along a wall fits, too, though less.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen{
      Eigen::Matrix3d{out.information.topLeftCorner<3, 3>()}};
  Vector6d slide = Vector6d::Zero();
  slide.head<3>() = eigen.eigenvectors().col(0);
  const Se3 first = out.T_odom_camera;
  for (const double way : {kSlideM, -kSlideM}) {
    const Se3 start = first * Se3::exp(way * slide);
    const Alignment other = aligner.run(frame, {&reference, 1}, {start, prior.information},
                                        {start, kStartSlack, kStartSlack}, no_photo, deadline);
    if (recognised(other, config_) && other.overlap > out.overlap) out = other;
  }
  return true;
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

StoredView Relocaliser::place_of(const KeyframePool& pool, std::size_t which) const noexcept {
  if (which >= pool.size()) return views_->at(which - pool.size());
  return {pool.place(which).T_odom_camera, pool.place(which).segment};
}

Relocaliser::Recognitions Relocaliser::run(const PatchView& frame, const KeyframePool& pool,
                                           PatchAligner& aligner, PhotoTerm& no_photo,
                                           const Whereabouts& whereabouts, std::size_t most,
                                           Deadline deadline) noexcept {
  Recognitions found;
  const std::size_t count = all(pool);
  const std::size_t first = likeliest(frame, pool, whereabouts);
  int tries = 0;
  int draws = 0;
  for (std::size_t i = 0; i <= count && tries < kTries && draws < kDraws; ++i) {
    if (tries + draws > 0 && deadline.expired()) break;
    if (i > 0) {
      next_ = (next_ + 1) % count;
      ++passed_;
    }
    if (i == 0 ? first == kNothing : next_ == first) continue;
    const std::size_t which = i == 0 ? first : next_;
    const StoredView at = place_of(pool, which);
    if (!may_be(whereabouts, at)) continue;
    const bool stored = which >= pool.size();
    Reference reference{&drawn_view_, at.T_odom_view.inverse()};
    if (stored) {
      ++draws;
      if (!views_->draw(which - pool.size(), frame.camera(), *drawn_)) continue;
      drawn_view_.assign(*drawn_, config_);
    } else {
      reference = pool.reference(which);
    }
    if (frame.share_on(*reference.view, Se3{}) < kScreen) continue;
    ++tries;
    Recognition tried;
    if (!recognise(frame, reference, aligner, no_photo, deadline, tried.alignment)) continue;
    const Se3& T_odom_camera = tried.alignment.T_odom_camera;
    if (!within_gate(whereabouts.T_odom_camera.inverse() * T_odom_camera,
                     covariance_of(whereabouts, at.segment))) {
      continue;
    }
    tried.segment = at.segment;
    tried.stored = stored;
    tried.telling = telling(*reference.view, frame, reference.T_reference_odom * T_odom_camera);
    found.push_back(tried);
    if (found.size() == most) break;
  }
  return found;
}

}  // namespace maplet
