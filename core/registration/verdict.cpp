// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/verdict.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr double kNear_m = 0.2;  // of the truth, once a region's planes have said where
constexpr double kNear_rad = 0.15;
constexpr double kSame_m = 0.03;
constexpr double kSame_rad = 0.02;
constexpr double kSamePlace_m = 0.1;
constexpr double kSamePlace_rad = 0.05;
constexpr double kStrict = 0.7;  // of the limits for fit and conflict, with nothing known before
constexpr double kClearlyBetter = 1.1;  // times the evidence: the answer was a wrong one
constexpr int kRounds = 2;
constexpr double kNearlyAsGood = 0.8;  // of the best hypothesis' matched area and pairs

constexpr Judgement kNoTime{Verdict::kUndecided, "no time left"};

// Matched area, less where the fit is bad.
double score(const MapletAlignment& alignment) noexcept {
  return alignment.overlap / (1.0 + alignment.chi2_per_dof);
}

// Whether one start led to where another did.
bool same(const Se3& x, const Se3& y) noexcept {
  const Vector6d apart = (x.inverse() * y).log();
  return apart.head<3>().norm() < kSame_m && apart.tail<3>().norm() < kSame_rad;
}

// Whether y is another place than the alignment's, free axes aside.
bool differ(const MapletAlignment& x, const Se3& y) noexcept {
  Vector6d apart = (x.T_a_b.se3.inverse() * y).log();
  for (const Vector6d& axis : x.free_axes) apart -= axis.dot(apart) * axis;
  return apart.head<3>().norm() > kSamePlace_m || apart.tail<3>().norm() > kSamePlace_rad;
}

}  // namespace

bool known_closely(const MapletAlignment& found, const RegistrationConfig& config) noexcept {
  const double tail = std::max(1.0, found.chi2_per_dof / found.spread);
  const double m2 = tail * found.covariance.topLeftCorner<3, 3>().trace();
  const double rad2 = tail * found.covariance.bottomRightCorner<3, 3>().trace();
  return std::sqrt(m2) <= config.accept_sigma_m && std::sqrt(rad2) <= config.accept_sigma_rad;
}

Judgement judge_alignment(const MapletAlignment& found, const Evidence& evidence, Prior prior,
                          const RegistrationConfig& config) noexcept {
  if (found.stop == Stop::kDeadline) return kNoTime;
  if (found.chi2_per_dof > config.reject_chi2_per_dof) {
    return {Verdict::kReject, "the planes do not fit"};
  }
  if (evidence.contradiction() > config.reject_conflict) {
    if (!found.free_axes.empty()) {  // elsewhere along it they may not
      return {Verdict::kUndecided, "one saw through the other's surfaces, but an axis is free"};
    }
    return {Verdict::kReject, "one saw through the other's surfaces"};
  }
  if (found.matches < config.accept_matches) return {Verdict::kUndecided, "too few planes"};
  if (found.overlap < config.accept_overlap) return {Verdict::kUndecided, "too little overlap"};
  const double strict = prior == Prior::kNone ? kStrict : 1.0;
  if (found.chi2_per_dof > strict * config.accept_chi2_per_dof) {
    return {Verdict::kUndecided, "the planes fit badly"};
  }
  if (evidence.contradiction() > strict * config.accept_conflict) {
    return {Verdict::kUndecided, "one may have seen through the other's surfaces"};
  }
  if (found.free_axes.size() > (prior == Prior::kPath ? 1U : 0U)) {
    return {Verdict::kUndecided, "the planes leave an axis free"};
  }
  if (prior == Prior::kNone && !known_closely(found, config)) return kNotClosely;
  if (prior == Prior::kNone && evidence.small_agreed < config.accept_detail) {
    return {Verdict::kUndecided, "walls and floor agree, too little else"};
  }
  return {Verdict::kAccept, "planes agree"};
}

Closure Verifier::verify(const Maplet& a, const Maplet& b, const Transform<MapletA, MapletB>& guess,
                         double gate_m, double gate_rad, Prior prior, Deadline deadline) noexcept {
  Closure out = align(a, b, guess, gate_m, gate_rad, deadline);
  judge(a, b, out, gate_m, gate_rad, prior, deadline);
  return out;
}

Closure Verifier::align(const Maplet& a, const Maplet& b, const Transform<MapletA, MapletB>& guess,
                        double gate_m, double gate_rad, Deadline deadline) noexcept {
  Closure out;
  const auto alignment = find(a, b, guess, gate_m, gate_rad, deadline);
  if (!alignment) {
    out.judgement = {Verdict::kReject, alignment.error().what};
    return out;
  }
  out.aligned = true;
  out.alignment = *alignment;
  return out;
}

Expected<MapletAlignment> Verifier::find(const Maplet& a, const Maplet& b,
                                         const Transform<MapletA, MapletB>& guess, double gate_m,
                                         double gate_rad, Deadline deadline) noexcept {
  if (region_ != nullptr) {
    icap_.look_at(region_);
    const auto there = icap_.align(a, b, guess, gate_m, gate_rad, deadline);
    icap_.look_at(nullptr);
    if (there && there->matches >= config_.accept_matches && there->free_axes.empty()) {
      return icap_.align(a, b, there->T_a_b, std::min(gate_m, kNear_m),
                         std::min(gate_rad, kNear_rad), deadline);
    }
  }
  return icap_.align(a, b, guess, gate_m, gate_rad, deadline);
}

void Verifier::judge(const Maplet& a, const Maplet& b, Closure& closure, double gate_m,
                     double gate_rad, Prior prior, Deadline deadline) noexcept {
  if (!closure.aligned) return;
  Judgement& out = closure.judgement;
  if (closure.alignment.stop == Stop::kDeadline) {
    out = kNoTime;
    return;
  }
  for (int round = 0;; ++round) {
    const Evidence evidence = weigh_evidence(a, b, closure.alignment.T_a_b.se3, deadline);
    if (!evidence.complete) {
      out = kNoTime;
      return;
    }
    closure.conflict = evidence.contradiction();
    out = judge_alignment(closure.alignment, evidence, prior, config_);
    const Rivals rivals =
        look_beside(a, b, closure.alignment, evidence.value(), gate_m, gate_rad, deadline);
    if (rivals.better && round < kRounds) {
      closure.alignment = *rivals.better;
      continue;
    }
    if (out.verdict != Verdict::kAccept) return;
    if (rivals.better || rivals.as_good) {
      out = {Verdict::kUndecided, "another place fits nearly as well"};
    } else if (!rivals.in_time) {
      out = kNoTime;
    }
    return;
  }
}

// Starts again beside the answer, as far as the gates reach.
Verifier::Rivals Verifier::look_beside(const Maplet& a, const Maplet& b,
                                       const MapletAlignment& best, double value, double gate_m,
                                       double gate_rad, Deadline deadline) noexcept {
  Rivals out;
  double most = kClearlyBetter * std::max(0.0, value);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      if (deadline.expired()) {
        out.in_time = false;
        return out;
      }
      Vector6d step = Vector6d::Zero();
      step[axis] = side * gate_m;
      const Transform<MapletA, MapletB> start{best.T_a_b.se3 * Se3::exp(step)};
      const auto other = icap_.align(a, b, start, 0.6 * gate_m, 0.6 * gate_rad, deadline);
      if (!other) continue;
      const double worth = score(*other);
      if (worth <= kNearlyAsGood * score(best)) continue;
      out.as_good = out.as_good || differ(best, other->T_a_b.se3);
      // One with a free axis lies along it where it was started, a gate away.
      if (!other->free_axes.empty() || other->stop == Stop::kDeadline ||
          same(best.T_a_b.se3, other->T_a_b.se3)) {
        continue;
      }
      const Evidence found = weigh_evidence(a, b, other->T_a_b.se3, deadline);
      if (!found.complete) {
        out.in_time = false;
        return out;
      }
      if (found.value() <= most) continue;
      most = found.value();
      out.better = *other;
    }
  }
  return out;
}

}  // namespace maplet
