// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/patch_aligner.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr double kMinScale = 0.2;       // of s = 1 + q.p: a plane seen almost edge-on is no witness
constexpr double kSlackShrinks = 0.25;  // from an association to the next
// What is left of it: patches of two frames are cut differently, and without any slack those that
// agree with the start keep it where it is. Measured (docs/math/odometry.md).
constexpr double kFineM = 0.0025;
constexpr double kFineRad = 0.001;
constexpr std::size_t kHalfway = 400;  // patches between the coarse stage and all
constexpr int kStepsPerAssociation = 2;
constexpr double kStepM = 5e-4;
constexpr double kStepRad = 2.5e-4;
constexpr double kMaxChi2PerDof = 2.5;
// Walls and floors look alike: of any two views of rooms a third agrees somewhere by chance.
constexpr double kMinAgreement = 0.55;
constexpr double kMuchSeen = 0.3;
// What nobody has seen stand still yet: trusted as long as it agrees with what did.
constexpr double kHardly = 1e-3;
constexpr double kBelieved = 4.0;  // squared sigmas per degree of freedom

// How far parts of the evidence pull apart (eq. 15), whitened by the whole.
struct Pull {
  double squared = 0.0;
  double expected = 0.0;
};
Pull pull_of(const NormalEquations& part, const Whitening& white, const Vector6d& step) noexcept {
  const Matrix6d share = white.basis.transpose() * part.information * white.basis;
  const Vector6d pull = white.basis.transpose() * part.gradient - share * step;
  return {pull.squaredNorm(), share.trace() - share.squaredNorm()};
}

}  // namespace

bool usable(const Alignment& alignment, const OdometryConfig& config) noexcept {
  return alignment.inliers >= static_cast<std::uint32_t>(config.min_pairs) &&
         alignment.overlap >= config.min_overlap && alignment.agreement >= kMinAgreement &&
         alignment.chi2_per_dof < kMaxChi2PerDof;
}

bool recognised(const Alignment& alignment, const OdometryConfig& config) noexcept {
  return usable(alignment, config) && alignment.overlap > kFoundOverlap &&
         alignment.free_axes.empty();
}

PatchAligner::PatchAligner(const OdometryConfig& config, Arena& arena)
    : config_{config},
      pairs_{arena.make_array<FacetPair>(facets_of(config) * kMaxReferences, "odometry/pairs")} {
  scale_ << Eigen::Vector3d::Constant(config_.free_m), Eigen::Vector3d::Constant(config_.free_rad);
}

void PatchAligner::associate(const PatchView& frame, References references, const Se3& T,
                             const Slack& slack) noexcept {
  pair_count_ = 0;
  for (std::size_t r = 0; r < references.size(); ++r) {
    landed_[r] = associate_with(frame, references[r], T, slack);
    pair_end_[r] = pair_count_;
  }
}

// @return pixels of the frame on patches of the reference
double PatchAligner::associate_with(const PatchView& frame, const Reference& reference,
                                    const Se3& T, const Slack& slack) noexcept {
  const double min_cosine = std::cos(config_.gate_rad);
  // The pose of the frame before is itself an estimate, about as good as this one will be.
  const double noise = config_.noise_scale * config_.noise_scale * (reference.previous ? 2.0 : 1.0);
  const Se3 T_reference_camera = reference.T_reference_odom * T;
  const Eigen::Matrix3d R_rc = T_reference_camera.rotation();
  const PlaneMotion motion{T_reference_camera};
  const Eigen::Vector3d Rp = motion.R.transpose() * motion.p;
  double landed = 0.0;
  for (const Facet& facet : frame.facets().first(slack.facets)) {
    if (facet.moved) continue;
    const int found = reference.view->at(times(R_rc, facet.centre) + T_reference_camera.t);
    if (found == PatchView::kNone) continue;
    const Facet& other = reference.view->facets()[static_cast<std::size_t>(found)];
    if (other.moved) continue;
    landed += facet.pixels;
    const Eigen::Vector3d q = times(motion.R, other.theta);
    const double s = 1.0 + dot(q, motion.p);
    if (s < kMinScale) continue;
    const Eigen::Vector3d theta = q / s;  // eq. 1
    const double norm2 = dot(theta, theta);
    const double cosine = dot(theta, facet.theta);
    if (cosine < min_cosine * std::sqrt(norm2 * dot(facet.theta, facet.theta))) continue;
    // Eq. 3: the residual's covariance; slack is what the start may be off.
    const Eigen::Matrix3d J = (motion.R - theta * Rp.transpose()) * (1.0 / s);
    const double widen = norm2 * (slack.rad * slack.rad + norm2 * slack.m * slack.m);
    Sym3 covariance = (facet.covariance + congruence(J, other.covariance)) * noise;
    covariance.xx += widen;
    covariance.yy += widen;
    covariance.zz += widen;
    const Sym3 weight = covariance.inverse();
    const Eigen::Vector3d residual = facet.theta - theta;
    if (!(dot(residual, weight * residual) < config_.gate_chi2)) continue;
    pairs_[pair_count_++] = {&facet, &other, weight};
  }
  return landed;
}

PairEvidence PatchAligner::evidence(References references, const Se3& T) const noexcept {
  PairEvidence sums;
  for (std::size_t r = 0; r < references.size(); ++r) {
    sums += evidence_of(pairs_of(r), PlaneMotion{references[r].T_reference_odom * T});
  }
  return sums;
}

Matrix6d PatchAligner::spurious(References references, const Se3& T) const noexcept {
  Matrix6d out = Matrix6d::Zero();
  for (std::size_t r = 0; r < references.size(); ++r) {
    out +=
        spurious_information(pairs_of(r), PlaneMotion{references[r].T_reference_odom * T}, trust_);
  }
  return out;
}

// The next association's slack and patches: coarse ones until the slack is used up, some in
// between, then all. @return whether these are all
bool PatchAligner::finer(Slack& slack, const PatchView& frame) const noexcept {
  const std::size_t all = frame.facets().size();
  const std::size_t few = std::min(all, static_cast<std::size_t>(config_.coarse_patches));
  if (slack.facets == 0) {
    slack.facets = few;
    return few == all && slack.m <= kFineM && slack.rad <= kFineRad;
  }
  slack.m = std::max(kFineM, kSlackShrinks * slack.m);
  slack.rad = std::max(kFineRad, kSlackShrinks * slack.rad);
  if (slack.m > kFineM || slack.rad > kFineRad) return false;
  slack.facets = slack.facets < kHalfway ? std::min(all, kHalfway) : all;
  return slack.facets == all;
}

Alignment PatchAligner::run(const PatchView& frame, References references, const PosePrior& prior,
                            const Start& start, PhotoTerm& photo, Deadline deadline) noexcept {
  Alignment out;
  out.T_odom_camera = start.T_odom_camera;
  out.stop = Stop::kIterationLimit;
  Slack slack{std::max(kFineM, start.sigma_m), std::max(kFineRad, start.sigma_rad), 0};
  Matrix6d noise = Matrix6d::Zero();
  bool last = false;
  trust_ = kHardly;
  int level = photo.empty() ? 0 : GrayPyramid::kLevels;
  for (int i = 0; i < config_.max_iterations; ++i) {
    if (out.iterations > 0 && deadline.expired()) {
      out.stop = Stop::kDeadline;
      break;
    }
    const bool again = i % kStepsPerAssociation == 0;
    if (again) {
      last = finer(slack, frame);
      level = std::max(0, level - 1);
      associate(frame, references, out.T_odom_camera, slack);
      noise = spurious(references, out.T_odom_camera);
    }
    const Vector6d to_prior = (out.T_odom_camera.inverse() * prior.T_odom_camera).log();
    const PairEvidence seen = evidence(references, out.T_odom_camera);
    trust_ = seen.disagreement({prior.information, prior.information * to_prior}) < kBelieved
                 ? 1.0
                 : kHardly;
    NormalEquations sums = seen.whole(trust_);
    photo.accumulate(out.T_odom_camera, level, sums.information, sums.gradient);
    const KnownDirections known = known_directions(sums.information, sums.gradient, noise, scale_);
    const Matrix6d held = prior.information + known.pin;
    const Matrix6d hessian = known.information + held;
    const Vector6d step = hessian.ldlt().solve(known.gradient + held * to_prior);
    if (!step.allFinite()) break;
    out.T_odom_camera = out.T_odom_camera * Se3::exp(step);
    ++out.iterations;
    const bool small = step.head<3>().norm() < kStepM && step.tail<3>().norm() < kStepRad;
    if (last && level == 0 && !again && small) {
      out.stop = Stop::kConverged;
      break;
    }
  }
  judge(frame.facets().first(slack.facets), references, out);
  weigh(references, photo, out);
  return out;
}

void PatchAligner::judge(std::span<const Facet> facets, References references,
                         Alignment& out) noexcept {
  blocks_.clear();
  double chi2 = 0.0;
  double all_pixels = 1.0;
  for (const Facet& facet : facets) all_pixels += facet.moved ? 0.0 : facet.pixels;
  for (std::size_t r = 0; r < references.size(); ++r) {
    const PlaneMotion motion{references[r].T_reference_odom * out.T_odom_camera};
    const PairVerdict verdict =
        judge_pairs(pairs_of(r), motion, trust_, references[r].previous ? nullptr : &blocks_);
    chi2 += verdict.chi2;
    const double overlap = verdict.pixels / all_pixels;
    if (overlap > out.overlap) {
      out.overlap = overlap;
      out.agreement = verdict.pixels / std::max(1.0, landed_[r]);
    }
    if (overlap > kMuchSeen) {
      out.most_agreement = std::max(out.most_agreement, verdict.pixels / std::max(1.0, landed_[r]));
    }
    if (r == 0) out.first_overlap = overlap;
    if (r == 1 && !references[r].previous) {
      out.older_agreement = verdict.pixels / std::max(1.0, landed_[r]);
    }
    out.inliers += verdict.inliers;
  }
  if (out.inliers > 0) out.chi2_per_dof = chi2 / (3.0 * out.inliers);
}

// What the keyframes alone tell of the pose, with the disagreement of the image's regions and of
// the keyframes (eq. 13-15).
void PatchAligner::weigh(References all, PhotoTerm& photo, Alignment& out) noexcept {
  std::size_t count = 0;
  while (count < all.size() && !all[count].previous) ++count;
  const References references = all.first(count);
  const Se3& T = out.T_odom_camera;
  std::array<NormalEquations, kMaxReferences> parts;
  NormalEquations whole;
  for (std::size_t r = 0; r < count; ++r) {
    parts[r] =
        evidence_of(pairs_of(r), PlaneMotion{references[r].T_reference_odom * T}).whole(trust_);
    whole += parts[r];
  }
  if (!photo.empty()) {
    NormalEquations points;
    photo.accumulate(T, 0, points.information, points.gradient);
    weigh_photo(whole, points, photo, out);
    out.gray = photo.seen() > 0;
    parts[0] += points;
    whole += points;
  }
  const KnownDirections known =
      known_directions(whole.information, whole.gradient, spurious(references, T), scale_);
  out.free_axes = known.free_axes;
  out.information = blocks_.calibrate(known.information, scale_);
  if (count < 2) return;
  const Whitening white{known.information, scale_};
  const Vector6d step = white.basis.transpose() * whole.gradient;
  for (std::size_t r = 0; r < count; ++r) {
    const Pull pull = pull_of(parts[r], white, step);
    out.disagreement += pull.squared;
    out.expected_disagreement += pull.expected;
  }
}

// Points of intensity are many and far from independent: what they say is measured against what
// the patches say, by regions of the image and as a whole.
void PatchAligner::weigh_photo(const NormalEquations& patches, const NormalEquations& points,
                               PhotoTerm& photo, Alignment& out) noexcept {
  const double of_patches = blocks_.inflation(patches.information, scale_);
  photo.add_scores(out.T_odom_camera, blocks_);
  out.photo_inflation = photo.measured_inflation() / of_patches;
  const Whitening white{patches.information + points.information, scale_};
  const Vector6d step = white.basis.transpose() * (patches.gradient + points.gradient);
  const Pull pull = pull_of(points, white, step);
  out.photo_disagreement = pull.squared;
  out.expected_photo_disagreement = pull.expected;
}

}  // namespace maplet
