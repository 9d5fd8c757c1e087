// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/patch_aligner.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr double kTailDof = 5.0;        // of the t-distribution of residuals
constexpr double kMinScale = 0.2;       // of s = 1 + q.p: a plane seen almost edge-on is no witness
constexpr double kSlackShrinks = 0.25;  // from an association to the next
// What is left of it: patches of two frames are cut differently, and without any slack those that
// agree with the start keep it where it is. Measured (docs/math/odometry.md).
constexpr double kFineM = 0.003;
constexpr double kFineRad = 0.001;
constexpr double kInlierChi2 = 16.27;  // 99.9 % of 3 degrees of freedom
constexpr int kStepsPerAssociation = 2;
constexpr double kStepM = 1e-4;
constexpr double kStepRad = 5e-5;
constexpr double kPin = 1e4;       // information along free axes, per squared scale
constexpr double kSpurious = 2.0;  // information must exceed that of noisy normals by this factor

// E[skew(x)^T w skew(x)] for x with second moment m.
Eigen::Matrix3d skew_moment(const Eigen::Matrix3d& m, const Eigen::Matrix3d& w) noexcept {
  const Eigen::Matrix3d product = m * w;
  return (m.trace() * w.trace() - product.trace()) * Eigen::Matrix3d::Identity() - w.trace() * m -
         m.trace() * w + product + product.transpose();
}

// Of T_camera_reference, right-perturbed on the camera's side.
struct Motion {
  Eigen::Matrix3d R;
  Eigen::Vector3d p;

  explicit Motion(const Se3& T_reference_camera) noexcept
      : R{T_reference_camera.rotation().transpose()}, p{-(R * T_reference_camera.t)} {}
};

// Which directions the patches know, in units of what counts as known.
struct Known {
  Matrix6d information = Matrix6d::Zero();  // of the directions kept
  Vector6d gradient = Vector6d::Zero();
  Matrix6d pin = Matrix6d::Zero();  // holds the free directions to the prior
  StaticVector<Vector6d, 6> free_axes;
};

// Eq. 6-7: drops the directions that are known worse than `scale` or only through noisy normals.
Known project(const Matrix6d& information, const Vector6d& gradient, const Matrix6d& spurious,
              const Vector6d& scale) noexcept {
  const Matrix6d scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Matrix6d noise = scale.asDiagonal() * spurious * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen{scaled};
  Known known;
  Matrix6d kept = Matrix6d::Identity();
  for (int i = 0; i < 6; ++i) {
    const Vector6d axis = eigen.eigenvectors().col(i);
    const double from_noise = kSpurious * axis.dot(noise * axis);
    if (eigen.eigenvalues()[i] - from_noise >= 1.0) continue;
    kept -= axis * axis.transpose();
    known.free_axes.push_back(scale.cwiseProduct(axis).normalized());
  }
  const Vector6d inverse = scale.cwiseInverse();
  known.information = inverse.asDiagonal() * (kept * scaled * kept) * inverse.asDiagonal();
  known.gradient = inverse.asDiagonal() * (kept * (scale.asDiagonal() * gradient));
  // The axes themselves are a little noisy: with a weak prior alone, what they leak would be
  // followed.
  known.pin = kPin * (inverse.asDiagonal() * (Matrix6d::Identity() - kept) * inverse.asDiagonal());
  return known;
}

}  // namespace

struct PatchAligner::Sums {
  Matrix6d information = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
};

PatchAligner::PatchAligner(const OdometryConfig& config, Arena& arena)
    : config_{config},
      pairs_{arena.make_array<Pair>(kMaxPatches * kMaxReferences, "odometry/pairs")} {}

void PatchAligner::associate(const PatchView& frame, std::span<const Reference> references,
                             const Se3& T, const Slack& slack) noexcept {
  pair_count_ = 0;
  for (std::size_t r = 0; r < references.size(); ++r) {
    associate_with(frame, references[r], T, slack);
    pair_end_[r] = pair_count_;
  }
}

void PatchAligner::associate_with(const PatchView& frame, const Reference& reference, const Se3& T,
                                  const Slack& slack) noexcept {
  const double min_cosine = std::cos(config_.gate_rad);
  const double noise = config_.noise_scale * config_.noise_scale;
  const Se3 T_reference_camera = reference.T_reference_odom * T;
  const Eigen::Matrix3d R_rc = T_reference_camera.rotation();
  const Motion motion{T_reference_camera};
  for (const Facet& facet : frame.facets().first(slack.facets)) {
    const int found = reference.view->at(R_rc * facet.centre + T_reference_camera.t);
    if (found == PatchView::kNone) continue;
    const Facet& other = reference.view->facets()[static_cast<std::size_t>(found)];
    const Eigen::Vector3d q = motion.R * other.theta;
    const double s = 1.0 + q.dot(motion.p);
    if (s < kMinScale) continue;
    const Eigen::Vector3d theta = q / s;  // eq. 1
    const double norm = theta.norm();
    if (theta.dot(facet.theta) < min_cosine * norm * facet.theta.norm()) continue;
    // Eq. 3: the residual's covariance; slack is what the start may be off.
    const Eigen::Matrix3d J = (motion.R - theta * (motion.p.transpose() * motion.R)) / s;
    const double widen = norm * norm * (slack.rad * slack.rad + norm * norm * slack.m * slack.m);
    Eigen::Matrix3d covariance = noise * (facet.covariance + J * other.covariance * J.transpose());
    covariance.diagonal().array() += widen;
    const Eigen::Matrix3d weight = covariance.inverse();
    const Eigen::Vector3d residual = facet.theta - theta;
    if (!(residual.dot(weight * residual) < config_.gate_chi2)) continue;
    pairs_[pair_count_++] = {&facet, &other, weight};
  }
}

PatchAligner::Sums PatchAligner::accumulate(std::span<const Reference> references,
                                            const Se3& T) const noexcept {
  Sums sums;
  Eigen::Matrix3d vv = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d vw = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d ww = Eigen::Matrix3d::Zero();
  std::size_t i = 0;
  for (std::size_t r = 0; r < references.size(); ++r) {
    const Motion motion{references[r].T_reference_odom * T};
    for (; i < pair_end_[r]; ++i) {
      const Pair& pair = pairs_[i];
      const Eigen::Vector3d q = motion.R * pair.reference->theta;
      const Eigen::Vector3d t = q / (1.0 + q.dot(motion.p));
      const Eigen::Vector3d residual = pair.frame->theta - t;
      const Eigen::Vector3d wr = pair.weight * residual;
      const double weight = (kTailDof + 3.0) / (kTailDof + residual.dot(wr));  // eq. 4
      // Eq. 5: the Jacobian of eq. 1 is [g g^T, [g]_x].
      const Eigen::Vector3d q0 = motion.R * pair.reference->surface;
      const Eigen::Vector3d g = q0 / (1.0 + q0.dot(motion.p));
      const Eigen::Vector3d wg = weight * (pair.weight * g);
      const Eigen::Matrix3d cross = skew(g);
      vv += (g.dot(wg) * g) * g.transpose();
      vw += g * wg.cross(g).transpose();
      ww += weight * (cross.transpose() * pair.weight * cross);
      sums.gradient.head<3>() += g * wg.dot(residual);
      sums.gradient.tail<3>() += weight * wr.cross(g);
    }
  }
  sums.information << vv, vw, vw.transpose(), ww;
  return sums;
}

Matrix6d PatchAligner::spurious(std::span<const Reference> references,
                                const Se3& T) const noexcept {
  Matrix6d out = Matrix6d::Zero();
  std::size_t i = 0;
  for (std::size_t r = 0; r < references.size(); ++r) {
    const Motion motion{references[r].T_reference_odom * T};
    for (; i < pair_end_[r]; ++i) {
      const Pair& pair = pairs_[i];
      const Eigen::Vector3d q = motion.R * pair.reference->surface;
      const double s = 1.0 + q.dot(motion.p);
      const Eigen::Vector3d t = q / s;
      const Eigen::Matrix3d J = (motion.R - t * (motion.p.transpose() * motion.R)) / s;
      const Eigen::Matrix3d moment = J * pair.reference->surface_covariance * J.transpose();
      out.topLeftCorner<3, 3>() += t.dot(pair.weight * t) * moment;
      out.bottomRightCorner<3, 3>() += skew_moment(moment, pair.weight);
    }
  }
  return out;
}

Alignment PatchAligner::run(const PatchView& frame, std::span<const Reference> references,
                            const PosePrior& prior, const Start& start,
                            Deadline deadline) noexcept {
  const std::size_t all = frame.facets().size();
  const std::size_t few = std::min(all, static_cast<std::size_t>(config_.coarse_patches));
  Vector6d scale;
  scale << Eigen::Vector3d::Constant(config_.free_m), Eigen::Vector3d::Constant(config_.free_rad);
  Alignment out;
  out.T_odom_camera = start.T_odom_camera;
  out.stop = Stop::kIterationLimit;
  Slack slack{start.sigma_m, start.sigma_rad, few};
  Matrix6d noise = Matrix6d::Zero();
  for (int i = 0; i < config_.max_iterations; ++i) {
    if (out.iterations > 0 && deadline.expired()) {
      out.stop = Stop::kDeadline;
      break;
    }
    const bool again = i % kStepsPerAssociation == 0;
    if (again) {
      if (slack.m < kFineM && slack.rad < kFineRad) slack.facets = all;
      if (slack.facets == all) slack = {kFineM, kFineRad, all};
      associate(frame, references, out.T_odom_camera, slack);
      noise = spurious(references, out.T_odom_camera);
    }
    const Sums sums = accumulate(references, out.T_odom_camera);
    const Known known = project(sums.information, sums.gradient, noise, scale);
    out.information = known.information;
    out.free_axes = known.free_axes;
    const Vector6d to_prior = (out.T_odom_camera.inverse() * prior.T_odom_camera).log();
    const Matrix6d held = prior.information + known.pin;
    const Matrix6d hessian = known.information + held;
    const Vector6d step = hessian.ldlt().solve(known.gradient + held * to_prior);
    if (!step.allFinite()) break;
    out.T_odom_camera = out.T_odom_camera * Se3::exp(step);
    ++out.iterations;
    const bool small = step.head<3>().norm() < kStepM && step.tail<3>().norm() < kStepRad;
    if (slack.facets == all && !again && small) {
      out.stop = Stop::kConverged;
      break;
    }
    if (!again && slack.facets != all) {
      slack.m *= kSlackShrinks;
      slack.rad *= kSlackShrinks;
    }
  }
  finish(frame.facets().first(slack.facets), references, out);
  return out;
}

void PatchAligner::finish(std::span<const Facet> facets, std::span<const Reference> references,
                          Alignment& out) const noexcept {
  double chi2 = 0.0;
  double all_pixels = 1.0;
  for (const Facet& facet : facets) all_pixels += facet.pixels;
  std::size_t i = 0;
  for (std::size_t r = 0; r < references.size(); ++r) {
    const Motion motion{references[r].T_reference_odom * out.T_odom_camera};
    double pixels = 0.0;
    std::uint32_t inliers = 0;
    for (; i < pair_end_[r]; ++i) {
      const Pair& pair = pairs_[i];
      const Eigen::Vector3d q = motion.R * pair.reference->theta;
      const Eigen::Vector3d residual = pair.frame->theta - q / (1.0 + q.dot(motion.p));
      const double squared = residual.dot(pair.weight * residual);
      if (squared > kInlierChi2) continue;
      chi2 += squared;
      pixels += pair.frame->pixels;
      ++inliers;
    }
    out.overlap = std::max(out.overlap, pixels / all_pixels);
    if (r == 0) out.first_overlap = pixels / all_pixels;
    out.inliers += inliers;
  }
  if (out.inliers > 0) out.chi2_per_dof = chi2 / (3.0 * out.inliers);
}

}  // namespace maplet
