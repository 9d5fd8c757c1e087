// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/base/arena.hpp"
#include "core/base/static_vector.hpp"
#include "core/registration/config.hpp"
#include "core/registration/place_prior.hpp"
#include "core/registration/verdict.hpp"

namespace maplet {

/// How the search for closures went. Counts since start-up.
struct ClosureCounts {
  std::uint64_t searched = 0;  ///< maplets
  std::uint64_t tried = 0;     ///< pairs
  std::uint64_t accepted = 0;
  std::uint64_t rejected = 0;
  std::uint64_t undecided = 0;
};

/// Looks for places seen again: older maplets that the skeleton puts near the newest one, verified.
/// Those come first beyond whose borders the newest one is, and what is looked at is the region
/// around these borders (paper: section III-B).
///
/// Memory   a Verifier in the arena
/// Time     at most kTries verifications; stops between them at the deadline
/// Threads  one
class ClosureFinder {
 public:
  static constexpr std::size_t kTries = 3;
  using Closures = StaticVector<DeltaPose, kTries>;

  ClosureFinder(const RegistrationConfig& config, Arena& arena);

  /// @return accepted closures from older maplets (a) to the newest (b)
  [[nodiscard]] Closures run(const Maplet& newest, PlacePrior& prior, Deadline deadline) noexcept;

  /// The camera moves in a plane only.
  void hold_to(const PlanarMotion& planar) noexcept { verifier_->hold_to(planar); }

  [[nodiscard]] const ClosureCounts& counts() const noexcept { return counts_; }

 private:
  struct Candidate {
    int index;
    double cost;
    Transform<MapletA, MapletB> T_a_b;
  };
  using Candidates = StaticVector<Candidate, kTries>;

  [[nodiscard]] Candidates nearest(const Maplet& newest, const PlacePrior& prior) const noexcept;

  RegistrationConfig config_;
  Arena::Owned<Verifier> verifier_;
  ClosureCounts counts_;
};

}  // namespace maplet
