// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/registration/config.hpp"
#include "core/registration/evidence.hpp"
#include "core/registration/icap.hpp"
#include "core/registration/place_compare.hpp"
#include "core/registration/surroundings.hpp"
#include "core/registration/usual_fit.hpp"
#include "core/registration/verdict.hpp"

namespace maplet {

/// How maplets of one agent lie to each other, as far as it is known: a place that fits has rivals
/// elsewhere and support nearby. The agent (or a tool) implements it.
class PlaceRelations {
 public:
  virtual ~PlaceRelations() = default;
  /// @return false when nothing relates x and y; x == y is never asked
  [[nodiscard]] virtual bool relate(const MapletKey& x, const MapletKey& y,
                                    Se3& T_x_y) const noexcept = 0;
};

/// One way in which two maplets may lie to each other, aligned and weighed.
struct PlaceHypothesis {
  MapletKey a, b;
  Stamp stamp_a{}, stamp_b{};
  MapletAlignment alignment;
  Evidence evidence;
  double doubt = 1.0;    ///< Icap::doubt()
  double value = 0.0;    ///< of the evidence, contradictions held against it
  double support = 0.0;  ///< value, and that of other pairs that say the same
  enum class Around : std::uint8_t { kUnknown, kFits, kContradicts } around = Around::kUnknown;
  Judgement alone;    ///< without a look at the others
  Judgement guessed;  ///< the same, if something had said where to look
  Judgement judgement;
};

/// Verifies candidates of the place index without any prior, several pairs together: a pair is
/// accepted when its planes agree, and no other place has nearly as much to say for itself. Its
/// owner looks at what lies around (Surroundings) before it believes what is accepted, and judges
/// again.
///
/// Memory   `capacity` hypotheses (~1 KB each) and an Icap in the arena
/// Time     add: an ICaP a guess and the evidence of at most kPerPair; judge: O(hypotheses^2),
/// small Threads  one caller at a time Math     docs/math/icap.md, section 8
class PlaceVerifier {
 public:
  static constexpr std::size_t kPerPair = 2;

  PlaceVerifier(const RegistrationConfig& config, std::size_t capacity, Arena& arena);

  void clear() noexcept { count_ = 0; }
  /// As Icap::hold_to(), of what is added from now on; nullopt: free again.
  void hold_to(const std::optional<PlanarMotion>& planar) noexcept { icap_->hold_to(planar); }

  /// Two consecutive maplets' planes fit like that: what is found from now on may not fit far
  /// worse.
  void note_fit(double chi2_per_dof) noexcept { usual_.note(chi2_per_dof); }

  /// Aligns b to a from each guess and keeps what comes out best.
  /// @return Stop::kDeadline when not all guesses were tried: the pair stays undecided
  Stop add(const Maplet& a, const Maplet& b, const PlaceCompare::Guesses& guesses,
           Deadline deadline) noexcept;

  /// The same a guess at a time, for whoever has little time at once.
  /// @return false when there is no room for another pair
  bool begin_pair() noexcept;
  /// @param keep_cut  keep what was found so far when time runs out; else nothing comes of it, and
  ///                  it can be tried again
  /// @return false when time ran out
  bool try_guess(const Maplet& a, const Maplet& b, const PlaceGuess& guess, Deadline deadline,
                 bool keep_cut) noexcept;
  /// @param in_time  all guesses were tried
  void end_pair(bool in_time) noexcept;

  /// Judges all hypotheses since clear(), each in the light of the others.
  void judge(const PlaceRelations& relations) noexcept;

  /// What two maplets around a hypothesis say of it: where their paths put them, and, should that
  /// not fit, where their planes do within what paths may drift.
  [[nodiscard]] Evidence weigh_around(const Maplet& a, const Maplet& b,
                                      const Surroundings::Pair& pair, Deadline deadline) noexcept;
  /// What all of them said of hypotheses()[index]: judge() takes it into account.
  void note_around(std::size_t index, bool contradicts) noexcept {
    using Around = PlaceHypothesis::Around;
    hypotheses_[index].around = contradicts ? Around::kContradicts : Around::kFits;
  }

  /// Whether `other` is another place for one of h's maplets, with nearly as much to say for itself
  /// as last judged. Both are of hypotheses().
  [[nodiscard]] bool rivals(const PlaceHypothesis& h, const PlaceHypothesis& other,
                            const PlaceRelations& relations) const noexcept;

  /// The best hypothesis of each pair has the pair's verdict; order of add.
  [[nodiscard]] std::span<const PlaceHypothesis> hypotheses() const noexcept {
    return hypotheses_.first(count_);
  }
  /// Pairs that found no room. Counts since start-up.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  [[nodiscard]] bool predict(const PlaceHypothesis& from, const PlaceHypothesis& to,
                             const PlaceRelations& relations, Se3& T_a_b,
                             double& apart_m) const noexcept;
  void gather_support(const PlaceRelations& relations) noexcept;
  [[nodiscard]] bool vouched_for(const PlaceHypothesis& h,
                                 const PlaceRelations& relations) const noexcept;
  [[nodiscard]] bool has_rival(const PlaceHypothesis& h,
                               const PlaceRelations& relations) const noexcept;

  RegistrationConfig config_;
  std::span<PlaceHypothesis> hypotheses_;
  std::size_t count_ = 0;
  std::size_t first_ = 0;  ///< of the present pair
  std::uint64_t dropped_ = 0;
  Arena::Owned<Icap> icap_;
  UsualFit usual_;
};

}  // namespace maplet
