// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "core/registration/evidence.hpp"
#include "core/registration/icap.hpp"

namespace maplet {

/// Whether two maplets show the same place. A false closure costs more than a missed one: accept
/// needs every test, reject a clear contradiction, the rest stays undecided.
enum class Verdict : std::uint8_t { kReject, kUndecided, kAccept };

[[nodiscard]] constexpr std::string_view to_string(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::kReject:
      return "reject";
    case Verdict::kUndecided:
      return "undecided";
    case Verdict::kAccept:
      return "accept";
  }
  return "?";
}

struct Judgement {
  Verdict verdict = Verdict::kUndecided;
  std::string_view reason;  ///< a literal
};

/// A pair of maplets, aligned and judged. Without an alignment the verdict is reject.
struct Closure {
  Judgement judgement;
  bool aligned = false;
  MapletAlignment alignment;
  double conflict = 0.0;  ///< Evidence::contradiction
};

/// What is known beforehand about how two maplets lie to each other.
enum class Prior : std::uint8_t {
  kNone,   ///< nothing: what is no wall or floor must agree, too
  kGuess,  ///< about where
  kPath,   ///< a path that fixes one axis which the planes may leave free (a corridor)
};

inline constexpr Judgement kNotClosely{Verdict::kUndecided,
                                       "the planes agree, but not on one place closely"};

/// Whether its covariance is within what a closure without a prior may have, were the planes that
/// fit worse than the middle one counted in full: where most agree and some do not, it is
/// elsewhere.
[[nodiscard]] bool known_closely(const MapletAlignment& alignment,
                                 const RegistrationConfig& config) noexcept;

/// What an alignment and its evidence are worth by themselves; rivals are for others to look for.
[[nodiscard]] Judgement judge_alignment(const MapletAlignment& alignment, const Evidence& evidence,
                                        Prior prior, const RegistrationConfig& config) noexcept;

/// Verifies that two maplets show the same place.
///
/// Memory   an Icap (~300 KB) inside the object
/// Time     one alignment, its free-space check and up to kAlternatives alignments more; stops
///          between them at the deadline, undecided
/// Threads  one caller at a time
/// Math     docs/math/icap.md, section 6
class Verifier {
 public:
  explicit Verifier(const RegistrationConfig& config) noexcept : config_{config}, icap_{config} {}

  /// The planes in this region say first how the two lie to each other; all of them are judged.
  /// @param region  of a's frame, kept; nullptr: all planes from the start
  void look_first_at(const RegionOfInterest* region) noexcept { region_ = region; }
  /// As Icap::hold_to().
  void hold_to(const PlanarMotion& planar) noexcept { icap_.hold_to(planar); }

  /// @param guess  within gate_m, gate_rad of the truth, if the two overlap at all
  [[nodiscard]] Closure verify(const Maplet& a, const Maplet& b,
                               const Transform<MapletA, MapletB>& guess, double gate_m,
                               double gate_rad, Prior prior, Deadline deadline) noexcept;
  /// The first half of verify(): the alignment alone, with no verdict yet.
  [[nodiscard]] Closure align(const Maplet& a, const Maplet& b,
                              const Transform<MapletA, MapletB>& guess, double gate_m,
                              double gate_rad, Deadline deadline) noexcept;
  /// The second: looks for other answers a gate away along each axis and takes one whose evidence
  /// is clearly better in place of the first, twice at most; then the verdict.
  void judge(const Maplet& a, const Maplet& b, Closure& closure, double gate_m, double gate_rad,
             Prior prior, Deadline deadline) noexcept;

 private:
  [[nodiscard]] Expected<MapletAlignment> find(const Maplet& a, const Maplet& b,
                                               const Transform<MapletA, MapletB>& guess,
                                               double gate_m, double gate_rad,
                                               Deadline deadline) noexcept;
  struct Rivals {
    std::optional<MapletAlignment> better;  ///< clearly: the answer was a wrong one
    bool as_good = false;                   ///< another place, nearly
    bool in_time = true;
  };
  /// @param value  of the evidence for `best`
  [[nodiscard]] Rivals look_beside(const Maplet& a, const Maplet& b, const MapletAlignment& best,
                                   double value, double gate_m, double gate_rad,
                                   Deadline deadline) noexcept;

  RegistrationConfig config_;
  const RegionOfInterest* region_ = nullptr;
  Icap icap_;
};

}  // namespace maplet
