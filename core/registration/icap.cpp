// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/icap.hpp"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "core/maplet/shared_keyframe.hpp"
#include "core/registration/observability.hpp"
#include "core/registration/pair_sums.hpp"

namespace maplet {

namespace {

// Of the planes' variances, what they have in common, and how much doubt there is whether residuals
// say what errors are. Maplets that share keyframes fit better than they are.
constexpr double kCommonShare = 0.001;
constexpr double kPriorDof = 0.25;
constexpr double kUsualKeyframes = 11.0;  // of a maplet whose planes are as unsure as they say
constexpr double kKinCommonShare = 0.003;
constexpr double kKinPriorDof = 1.0;
constexpr double kConverged_m = 2e-4;
constexpr double kConverged_rad = 1e-4;
constexpr double kVotesGate_m = 0.2;  // wider ones begin with votes
constexpr double kVotesGate_rad = 0.15;
constexpr float kLeastScore = 0.05F;
constexpr float kNearlyAsGood = 0.7F;  // of the best votes: worth a look at the extents
constexpr std::size_t kStarts = 3;
constexpr double kSamePairs_m = 5e-3;
constexpr double kSamePairs_rad = 3e-3;
constexpr double kGateShrink = 0.6;
constexpr double kLeastGate_m = 0.08;
constexpr double kLeastGate_rad = 0.08;
constexpr double kSlideStep_m = 0.1;
constexpr double kSlideGate_m = 0.1;
constexpr double kSlideGain = 1.1;  // what is shared beside the answer, times what is there
constexpr double kSlideAlong = 0.7;

// Whether pairs that were found at x are those that would be found at y.
bool close(const Se3& x, const Se3& y) noexcept {
  return (x.t - y.t).norm() < kSamePairs_m && x.q.angularDistance(y.q) < kSamePairs_rad;
}

// How many keyframes a maplet's planes are chained by, times what is usual. The coarsest layer of
// one does not say.
double chain_of(const Maplet& m) noexcept {
  return m.keyframes.size() > 1 ? static_cast<double>(m.keyframes.size()) / kUsualKeyframes : 1.0;
}

// What the planes of one maplet are off by together, because they share its path: no number of
// them averages it away. eq. 11b
struct Common {
  double m2 = 0.0;
  double rad2 = 0.0;
};

Common common_of(std::span<const PlanePair> pairs, double common_share) noexcept {
  Common out;
  double total = 0.0;
  for (const PlanePair& pair : pairs) {
    const double w = std::sqrt(pair.area_m2);
    const Eigen::Matrix3d sum = pair.a->plane->covariance + pair.b->plane->covariance;
    out.m2 += w * sum(2, 2);
    out.rad2 += w * 0.5 * (sum(0, 0) + sum(1, 1));
    total += w;
  }
  const double share = common_share / std::max(1e-9, total);
  return {share * out.m2, share * out.rad2};
}

// Adds an error that is the same in all directions about the pairs' middle, b's frame; what is free
// stays so.
void add_common(const Common& common, const Eigen::Vector3d& pivot, MapletAlignment& out) noexcept {
  Matrix6d spread = Matrix6d::Zero();
  spread.topLeftCorner<3, 3>().diagonal().setConstant(common.m2);
  spread.bottomRightCorner<3, 3>().diagonal().setConstant(common.rad2);
  const Matrix6d to_b = Se3{Eigen::Quaterniond::Identity(), pivot}.adjoint();
  const Matrix6d at_b = to_b * spread * to_b.transpose();
  out.covariance += at_b;
  const Matrix6d sum = at_b.inverse() + out.information;
  out.information -= out.information * sum.inverse() * out.information;
}

}  // namespace

DeltaPose closure_of(const MapletKey& a, Stamp stamp_a, const MapletKey& b, Stamp stamp_b,
                     const MapletAlignment& alignment) noexcept {
  DeltaPose out;
  out.kind = DeltaPose::Kind::kClosure;
  out.a = a;
  out.b = b;
  out.stamp_a = stamp_a;
  out.stamp_b = stamp_b;
  out.T_a_b = alignment.T_a_b;
  out.covariance = alignment.covariance;
  out.overlap = static_cast<float>(alignment.overlap);
  out.matches = alignment.matches;
  out.plane = alignment.plane;
  if (out.plane != PlaneCode::kSpace) {
    out.covariance = PlanarMotion{out.plane}.told(out.covariance);
  }
  return out;
}

Expected<MapletAlignment> Icap::align(const Maplet& a, const Maplet& b,
                                      const Transform<MapletA, MapletB>& guess, double gate_m,
                                      double gate_rad, Deadline deadline) noexcept {
  MapletAlignment out;
  if (a.planes.empty() || b.planes.empty()) {
    return fail(ErrorCode::kNoOverlap, "a maplet without planes");
  }
  if (planar_) out.plane = planar_->code();
  if (!guess.se3.t.allFinite() || !guess.se3.q.coeffs().allFinite()) {
    return fail(ErrorCode::kBadInput, "the guess is not finite");
  }
  kin_ = shared_keyframe(a, b).has_value();
  pairs_.prepare(a, b, region_, guess.se3);
  T_started_.reset();
  Se3 T = guess.se3;
  const bool wide = gate_m > kVotesGate_m || gate_rad > kVotesGate_rad;
  const double reach_m = gate_m;
  if (wide && start(a, b, T, gate_m, gate_rad, deadline)) {
    gate_m = std::min(gate_m, kVotesGate_m);
    gate_rad = std::min(gate_rad, kVotesGate_rad);
  }
  if (planar_) T = planar_->project(T);
  const Se3 held = planar_ ? T : guess.se3;  // where the pairs leave an axis free
  if (!settle(T, held, gate_m, gate_rad, deadline, out)) {
    return fail(ErrorCode::kNoOverlap, "too few planes in common");
  }
  conclude(T, out);
  if (wide && out.stop != Stop::kDeadline && !out.free_axes.empty()) {
    MapletAlignment slid;
    slid.iterations = out.iterations;
    double slid_m = kSlideGate_m;
    double slid_rad = kLeastGate_rad;
    if (slide(out, reach_m, T, deadline) && !deadline.expired() &&
        settle(T, Se3{T}, slid_m, slid_rad, deadline, slid)) {
      conclude(T, slid);
    }
    if (slid.worth > out.worth) {
      out = slid;
      gate_m = slid_m;
      gate_rad = slid_rad;
    } else {  // pairs() are the answer's
      pairs_.match(out.T_a_b.se3, kLeastGate_m, kLeastGate_rad, config_);
    }
  }
  if (!kin_) {  // eq. 11c
    const double chained = std::clamp(chain_of(a) + chain_of(b), 0.8, 4.0) / 2.0;
    out.covariance *= chained;
    out.information /= chained;
  }
  if (out.stop == Stop::kDeadline) {  // what is within the gates may still be the answer, eq. 11d
    const Common gates{gate_m * gate_m / 9.0, gate_rad * gate_rad / 9.0};
    add_common(gates, Eigen::Vector3d::Zero(), out);
    if (planar_) out.covariance = planar_->restrict_covariance(out.covariance);
  }
  return out;
}

// Matches and solves in turn, the gates narrowing. @return false: fewer pairs than it needs
bool Icap::settle(Se3& T, const Se3& held, double& gate_m, double& gate_rad, Deadline deadline,
                  MapletAlignment& out) noexcept {
  bool matched = false;
  Se3 T_matched;  // that the present pairs were found at
  bool matched_narrow = false;
  out.stop = Stop::kIterationLimit;
  for (int round = 0; round < config_.max_iterations; ++round) {
    if (deadline.expired()) {
      out.stop = Stop::kDeadline;
      break;
    }
    ++out.iterations;
    const bool narrow = gate_m <= kLeastGate_m && gate_rad <= kLeastGate_rad;
    if (!matched_narrow || !close(T_matched, T)) {
      pairs_.match(T, gate_m, gate_rad, config_);
      matched = true;
      matched_narrow = narrow;
      T_matched = T;
      if (static_cast<int>(pairs_.pairs().size()) < config_.min_matches) return false;
    }
    if (improve(T, held, !narrow) && narrow) {
      out.stop = Stop::kConverged;
      break;
    }
    gate_m = std::max(kLeastGate_m, kGateShrink * gate_m);
    gate_rad = std::max(kLeastGate_rad, kGateShrink * gate_rad);
  }
  if (matched) return true;
  // No time at all: what T would match.
  if (!T_started_ || !close(*T_started_, T)) pairs_.match(T, gate_m, gate_rad, config_);
  return !pairs_.pairs().empty();
}

// Planes that would fix a free axis lie out of sight of narrow gates: looks for them along it.
// @param T  where most is shared, within reach of the answer. @return whether that is elsewhere
bool Icap::slide(const MapletAlignment& from, double reach_m, Se3& T, Deadline deadline) noexcept {
  T_started_.reset();
  const Se3 middle = from.T_a_b.se3;
  double most = kSlideGain * from.worth;
  bool found = false;
  for (const Vector6d& axis : from.free_axes) {
    const Eigen::Vector3d way = axis.head<3>();
    if (way.norm() < kSlideAlong) continue;
    for (double at = -reach_m; at <= reach_m; at += kSlideStep_m) {
      if (deadline.expired()) return found;
      const Se3 beside{middle.q, middle.t + at * (middle.q * way.normalized())};
      pairs_.match(beside, kSlideGate_m, kLeastGate_rad, config_);
      if (pairs_.worth() <= most) continue;
      most = pairs_.worth();
      T = beside;
      found = true;
    }
  }
  return found;
}

// Far from the truth the nearest plane is often another one: the planes vote first.
bool Icap::start(const Maplet& a, const Maplet& b, Se3& T, double gate_m, double gate_rad,
                 Deadline deadline) noexcept {
  PlaceDescriptor::describe(a, place_a_);
  if (deadline.expired()) return false;
  PlaceDescriptor::describe(b, place_b_);
  if (deadline.expired()) return false;
  const auto found = compare_.guess_near(place_a_, place_b_, T, gate_m, gate_rad, deadline);
  if (found.empty() || found.front().score < kLeastScore) return false;
  Se3 best = found.front().T_a_b;
  const bool clear = found.size() == 1 || found[1].score < kNearlyAsGood * found.front().score;
  double most = -1.0;
  Duration matching{0};
  for (std::size_t i = 0; !clear && i < std::min(found.size(), kStarts); ++i) {
    // Where another one is worth less, the best one's pairs are found once more.
    if (found[i].score < kNearlyAsGood * found.front().score || deadline.remaining() < 2 * matching)
      break;
    const Duration before = deadline.remaining();
    pairs_.match(found[i].T_a_b, kVotesGate_m, kVotesGate_rad, config_);
    matching = before - deadline.remaining();
    T_started_ = found[i].T_a_b;
    const double worth = pairs_.worth();
    if (worth <= most) continue;
    most = worth;
    best = found[i].T_a_b;
  }
  T = best;
  return true;
}

// eq. 7, 8 (paper: eq. 4-8). What the pairs leave free stays at the guess.
void Icap::solve_closed_form(Se3& T, const Se3& guess) const noexcept {
  constexpr double kHold = 1e-3;
  const auto pairs = pairs_.pairs();
  double total = 0.0;
  Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
  for (const PlanePair& pair : pairs) {
    const Eigen::Vector3d r = residual(pair, T);
    const double w = pair.area_m2 * robust_weight(r.dot(pair.weight * r) / 25.0);
    h += w * pair.a->plane->plane.n * pair.b->plane->plane.n.transpose();
    total += w;
  }
  h += kHold * total * guess.rotation();
  const Eigen::JacobiSVD<Eigen::Matrix3d, Eigen::NoQRPreconditioner> svd{
      h, Eigen::ComputeFullU | Eigen::ComputeFullV};
  Eigen::Matrix3d fix = Eigen::Matrix3d::Identity();
  fix(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  T.q = Eigen::Quaterniond{svd.matrixU() * fix * svd.matrixV().transpose()};

  Eigen::Matrix3d normal = kHold * total * Eigen::Matrix3d::Identity();
  Eigen::Vector3d right = kHold * total * guess.t;
  for (const PlanePair& pair : pairs) {
    const Eigen::Vector3d r = residual(pair, T);
    const double w = pair.area_m2 * robust_weight(r[2] * r[2] * pair.weight(2, 2) / 25.0);
    const Eigen::Vector3d n = T.q * pair.b->plane->plane.n;
    // About the middle of what both saw: the planes' d amplify errors of direction.
    const double offset = n.dot(pair.tangent.centre) + pair.b->plane->plane.d;
    normal += w * n * n.transpose();
    right += w * offset * n;
  }
  T.t = normal.inverse() * right;
}

// One round under the present pairs. @return whether T hardly moved
bool Icap::improve(Se3& T, const Se3& guess, bool closed_form) noexcept {
  const Se3 before = T;
  if (closed_form) solve_closed_form(T, guess);
  if (planar_) T = planar_->project(T);
  PairSums sums = PairSums::of(pairs_.pairs(), T);
  if (planar_) sums.restrict_to(*planar_);
  const Observability seen =
      Observability::of(sums.information, sums.spurious, sums.pivot, config_.free_sigma_m);
  T = T * Se3::exp(-seen.step_inverse * sums.gradient);
  if (planar_) T = planar_->project(T);
  const Vector6d moved = (before.inverse() * T).log();
  return moved.head<3>().norm() < kConverged_m && moved.tail<3>().norm() < kConverged_rad;
}

void Icap::conclude(const Se3& T, MapletAlignment& out) noexcept {
  const auto pairs = pairs_.pairs();
  PairSums sums = PairSums::of(pairs, T);
  if (planar_) sums.restrict_to(*planar_);
  const Observability seen =
      Observability::of(sums.information, sums.spurious, sums.pivot, config_.free_sigma_m);
  const double known = (planar_ ? 3.0 : 6.0) - static_cast<double>(seen.free_axes.size());
  const double count = static_cast<double>(pairs.size());
  out.T_a_b = Transform<MapletA, MapletB>{T};
  const double dof = std::max(1.0, 3.0 * count - known);
  out.chi2_per_dof = sums.chi2 / dof;
  out.spread = spread_of(pairs, T);
  // Residuals say how large errors are, those of the pairs that hold the answer most of all; a few
  // of them do not say it well.
  const double prior = kin_ ? kKinPriorDof : kPriorDof;
  const double scale = (prior + dof * leverage_chi2(pairs, T, seen.step_inverse)) / (prior + dof);
  out.information = seen.information / scale;
  out.covariance = seen.covariance * scale + seen.free_covariance;
  const double common = kin_ ? kKinCommonShare : kCommonShare;
  add_common(common_of(pairs, common * std::min(1.0, scale)), sums.pivot, out);
  if (planar_) out.covariance = planar_->restrict_covariance(out.covariance);
  out.free_axes = seen.free_axes;
  out.matches = static_cast<std::uint16_t>(pairs.size());
  out.rms_m = std::sqrt(sums.squares_m2 / std::max(1.0, count));
  out.worth = pairs_.worth();
  out.overlap = std::min(
      1.0, pairs_.shared_m2() / std::max(1e-6, std::min(pairs_.area_a_m2(), pairs_.area_b_m2())));
}

double Icap::doubt(MapletAlignment& alignment) const noexcept {
  Matrix6d moved = leave_one_out(pairs_.pairs(), alignment.T_a_b.se3, config_.free_sigma_m);
  if (planar_) {
    const Matrix6d inside = planar_->basis() * planar_->basis().transpose();
    moved = inside * moved * inside;
  }
  const double before = alignment.covariance.topLeftCorner<3, 3>().trace();
  alignment.covariance += moved;
  return std::sqrt(alignment.covariance.topLeftCorner<3, 3>().trace() / std::max(1e-12, before));
}

}  // namespace maplet
