// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/place_verifier.hpp"

#include <algorithm>

namespace maplet {

namespace {

constexpr double kGate_m = 0.2;  // of a guess: bins and axes are that coarse
constexpr double kGate_rad = 0.15;
// The same place, seen from another pair: what the paths between may have drifted.
constexpr double kSame_m = 0.25;
constexpr double kSame_rad = 0.1;
constexpr double kDrift = 0.04;  // m per m of path
constexpr double kDrift_rad_per_m = 0.01;
constexpr double kNearlyAsGood = 0.7;    // of the better one's support
constexpr double kPlausible = 0.15;      // contradiction up to which a rival counts
constexpr double kMostDoubt = 2.4;       // times less sure when single pairs are left out
constexpr double kVouched = 0.5;         // times the tolerance above: surely the same
constexpr double kElsewhere = 2.0;       // times the tolerance above: surely another place
constexpr double kSupportReach_m = 8.0;  // further away paths may have drifted apart
constexpr double kAround_m = 0.1;        // of the maplets beside, and with the path
constexpr double kAroundDrift = 0.03;
constexpr double kAround_rad = 0.05;
constexpr double kAroundDrift_rad_per_m = 0.01;

constexpr Judgement kElseAround{Verdict::kUndecided,
                                "one saw through the other's surfaces around it"};

bool same_place(const Se3& x, const Se3& y, double apart_m, double factor = 1.0) noexcept {
  const Se3 d = x.inverse() * y;
  return d.t.norm() < factor * (kSame_m + kDrift * apart_m) &&
         d.angle() < factor * (kSame_rad + kDrift_rad_per_m * apart_m);
}

}  // namespace

PlaceVerifier::PlaceVerifier(const RegistrationConfig& config, std::size_t capacity, Arena& arena)
    : config_{config},
      hypotheses_{arena.make_array<PlaceHypothesis>(capacity, "registration/place hypotheses")},
      icap_{arena.make<Icap>("registration/place icap", config)} {}

Stop PlaceVerifier::add(const Maplet& a, const Maplet& b, const PlaceCompare::Guesses& guesses,
                        Deadline deadline) noexcept {
  if (!begin_pair()) return Stop::kIterationLimit;
  bool in_time = true;
  for (const PlaceGuess& guess : guesses) {
    if (deadline.expired()) in_time = false;
    if (!in_time) break;
    in_time = try_guess(a, b, guess, deadline, true);
  }
  end_pair(in_time);
  return in_time ? Stop::kConverged : Stop::kDeadline;
}

bool PlaceVerifier::begin_pair() noexcept {
  first_ = count_;
  if (count_ + kPerPair <= hypotheses_.size()) return true;
  ++dropped_;
  return false;
}

bool PlaceVerifier::try_guess(const Maplet& a, const Maplet& b, const PlaceGuess& guess,
                              Deadline deadline, bool keep_cut) noexcept {
  const auto found =
      icap_->align(a, b, Transform<MapletA, MapletB>{guess.T_a_b}, kGate_m, kGate_rad, deadline);
  if (!found) return true;
  bool in_time = found->stop != Stop::kDeadline;
  if (!in_time && !keep_cut) return false;
  const auto mine = hypotheses_.subspan(first_, count_ - first_);
  const bool known = std::any_of(mine.begin(), mine.end(), [&](const PlaceHypothesis& h) {
    return same_place(h.alignment.T_a_b.se3, found->T_a_b.se3, 0.0);
  });
  if (known) return in_time;
  PlaceHypothesis h;
  h.a = a.key;
  h.b = b.key;
  h.stamp_a = a.stamp;
  h.stamp_b = b.stamp;
  h.alignment = *found;
  h.doubt = icap_->doubt(h.alignment);
  h.evidence = weigh_evidence(a, b, found->T_a_b.se3, deadline);
  in_time = in_time && h.evidence.complete;
  if (!in_time && !keep_cut) return false;
  h.value = h.evidence.value();
  if (mine.size() < kPerPair) {
    hypotheses_[count_++] = h;
  } else if (h.value > mine.back().value) {
    mine.back() = h;
  }
  const auto sorted = hypotheses_.subspan(first_, count_ - first_);
  std::sort(sorted.begin(), sorted.end(),
            [](const auto& x, const auto& y) { return x.value > y.value; });
  return in_time;
}

void PlaceVerifier::end_pair(bool in_time) noexcept {
  for (PlaceHypothesis& h : hypotheses_.subspan(first_, count_ - first_)) {
    h.alone = judge_alignment(h.alignment, h.evidence, Prior::kNone, config_);
    h.guessed = judge_alignment(h.alignment, h.evidence, Prior::kGuess, config_);
    if (h.alone.verdict == Verdict::kAccept && h.alignment.chi2_per_dof > usual_.limit()) {
      h.alone = {Verdict::kUndecided, "the planes fit worse than those of one path do"};
    }
    if (h.guessed.verdict == Verdict::kAccept && !known_closely(h.alignment, config_)) {
      h.guessed = kNotClosely;
    }
    if (h.doubt > kMostDoubt) {
      for (Judgement* j : {&h.alone, &h.guessed}) {
        if (j->verdict == Verdict::kAccept) *j = {Verdict::kUndecided, "it rests on single planes"};
      }
    }
    if (!in_time) h.alone = h.guessed = {Verdict::kUndecided, "no time left"};
    h.judgement = h.alone;
  }
}

Evidence PlaceVerifier::weigh_around(const Maplet& a, const Maplet& b,
                                     const Surroundings::Pair& pair, Deadline deadline) noexcept {
  const Evidence there = weigh_evidence(a, b, pair.T_a_b, deadline);
  if (!there.complete || !Surroundings::contradicts(there)) return there;
  const auto found = icap_->align(a, b, Transform<MapletA, MapletB>{pair.T_a_b},
                                  kAround_m + kAroundDrift * pair.apart_m,
                                  kAround_rad + kAroundDrift_rad_per_m * pair.apart_m, deadline);
  if (!found) return there;
  const Evidence near = weigh_evidence(a, b, found->T_a_b.se3, deadline);
  return !near.complete || near.value() > there.value() ? near : there;
}

// Where `from` puts the pair of `to`. @return false when nothing relates them
bool PlaceVerifier::predict(const PlaceHypothesis& from, const PlaceHypothesis& to,
                            const PlaceRelations& relations, Se3& T_a_b,
                            double& apart_m) const noexcept {
  Se3 T_a_from;
  Se3 T_from_b;
  if (from.a != to.a && !relations.relate(to.a, from.a, T_a_from)) return false;
  if (from.b != to.b && !relations.relate(from.b, to.b, T_from_b)) return false;
  T_a_b = T_a_from * from.alignment.T_a_b.se3 * T_from_b;
  apart_m = T_a_from.t.norm() + T_from_b.t.norm() + T_a_from.angle() + T_from_b.angle();
  return true;
}

void PlaceVerifier::gather_support(const PlaceRelations& relations) noexcept {
  const auto all = hypotheses_.first(count_);
  for (PlaceHypothesis& h : all) {
    h.support = std::max(0.0, h.value);
    double best = 0.0;  // of the present other pair
    for (std::size_t i = 0; i < count_; ++i) {
      const PlaceHypothesis& other = all[i];
      const bool starts_pair = i == 0 || other.a != all[i - 1].a || other.b != all[i - 1].b;
      if (starts_pair) {
        h.support += best;
        best = 0.0;
      }
      if ((other.a == h.a && other.b == h.b) || other.value <= best) continue;
      if (other.evidence.contradiction() > kPlausible) continue;
      Se3 T;
      double apart_m = 0.0;
      if (!predict(h, other, relations, T, apart_m) || apart_m > kSupportReach_m) continue;
      if (same_place(T, other.alignment.T_a_b.se3, apart_m)) best = other.value;
    }
    h.support += best;
  }
}

// In the same pair nothing has drifted, and its own evidence decides; between pairs their support
// does.
bool PlaceVerifier::rivals(const PlaceHypothesis& h, const PlaceHypothesis& other,
                           const PlaceRelations& relations) const noexcept {
  if (&other == &h || (other.a != h.a && other.b != h.b)) return false;
  if (other.evidence.contradiction() > kPlausible || !other.alignment.free_axes.empty())
    return false;
  const bool same_pair = other.a == h.a && other.b == h.b;
  if (same_pair ? other.value < kNearlyAsGood * h.value
                : other.support < kNearlyAsGood * h.support) {
    return false;
  }
  Se3 T;
  double apart_m = 0.0;
  return predict(h, other, relations, T, apart_m) &&
         !same_place(T, other.alignment.T_a_b.se3, apart_m, same_pair ? 1.0 : kElsewhere);
}

bool PlaceVerifier::has_rival(const PlaceHypothesis& h,
                              const PlaceRelations& relations) const noexcept {
  return std::ranges::any_of(hypotheses_.first(count_), [&](const PlaceHypothesis& other) {
    return rivals(h, other, relations);
  });
}

// Whether a pair that was accepted by itself puts this one where it is.
bool PlaceVerifier::vouched_for(const PlaceHypothesis& h,
                                const PlaceRelations& relations) const noexcept {
  for (const PlaceHypothesis& other : hypotheses_.first(count_)) {
    if (other.alone.verdict != Verdict::kAccept || other.judgement.verdict != Verdict::kAccept) {
      continue;
    }
    if (other.a == h.a && other.b == h.b) continue;
    Se3 T;
    double apart_m = 0.0;
    if (!predict(other, h, relations, T, apart_m) || apart_m > kSupportReach_m) continue;
    if (same_place(T, h.alignment.T_a_b.se3, apart_m, kVouched)) return true;
  }
  return false;
}

void PlaceVerifier::judge(const PlaceRelations& relations) noexcept {
  gather_support(relations);
  for (std::size_t i = 0; i < count_; ++i) {
    PlaceHypothesis& h = hypotheses_[i];
    h.judgement = h.alone;
    if (h.alone.verdict != Verdict::kAccept) continue;
    if (h.around == PlaceHypothesis::Around::kContradicts) {
      h.judgement = kElseAround;
    } else if (has_rival(h, relations)) {
      h.judgement = {Verdict::kUndecided, "another place fits nearly as well"};
    }
  }
  // A neighbour that is sure of its place is as good as a guess: walls and floor will do.
  for (std::size_t i = 0; i < count_; ++i) {
    PlaceHypothesis& h = hypotheses_[i];
    if (h.alone.verdict == Verdict::kAccept || h.guessed.verdict != Verdict::kAccept) continue;
    if (!vouched_for(h, relations) || has_rival(h, relations)) continue;
    if (h.around == PlaceHypothesis::Around::kContradicts) {
      h.judgement = kElseAround;
    } else {
      h.judgement = {Verdict::kAccept, "planes agree, and neighbours say the same"};
    }
  }
}

}  // namespace maplet
