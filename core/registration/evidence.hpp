// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/deadline.hpp"
#include "core/geometry/se3.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet {

/// What two maplets say about each other's surfaces under a transform, plane by plane: roots of
/// areas (m), large planes alike, so that what stands about counts beside the walls.
struct Evidence {
  double agreed = 0.0;        ///< looked for and found
  double contradicted = 0.0;  ///< the other one looked through where it should be
  /// The same, of planes that are no wall or floor: smaller than kSmall_m2.
  double small_agreed = 0.0;
  bool complete = true;  ///< false: the deadline came first, the rest says nothing

  static constexpr double kSmall_m2 = 1.0;
  static constexpr double kContradictionCosts = 2.0;  ///< times what agreement brings

  /// What it says for the transform, contradictions held against it.
  [[nodiscard]] double value() const noexcept {
    return agreed - kContradictionCosts * contradicted;
  }
  /// Share of what was looked for that was not there, 0..1.
  [[nodiscard]] double contradiction() const noexcept {
    return contradicted / (agreed + contradicted + 1e-9);
  }
};

/// Casts rays from the keyframes of each maplet to samples of the other's planes: does it have the
/// surface there, something in front of it, or only something behind it?
///
/// Time   O(planes_a * planes_b): 0.2 to 2 ms; looks at the deadline for each plane
/// Math   docs/math/icap.md, section 6
[[nodiscard]] Evidence weigh_evidence(const Maplet& a, const Maplet& b, const Se3& T_a_b,
                                      Deadline deadline) noexcept;

}  // namespace maplet
