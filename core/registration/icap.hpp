// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/deadline.hpp"
#include "core/base/expected.hpp"
#include "core/base/static_vector.hpp"
#include "core/geometry/planar_motion.hpp"
#include "core/registration/config.hpp"
#include "core/registration/delta_pose.hpp"
#include "core/registration/fixed_list.hpp"
#include "core/registration/place_compare.hpp"
#include "core/registration/plane_pairs.hpp"

namespace maplet {

/// How two maplets lie to each other by their planes, and how sure that is.
struct MapletAlignment {
  Transform<MapletA, MapletB> T_a_b;
  Matrix6d covariance = Matrix6d::Zero();   ///< m^2, rad^2; tangent of b; wide along free axes
  Matrix6d information = Matrix6d::Zero();  ///< its inverse without doubt(), zero along free axes
  /// Unit tangents (b; rad scaled by 1 m) that the planes leave free: T_a_b keeps the guess there.
  FixedList<Vector6d, 6> free_axes;
  std::uint16_t matches = 0;
  double overlap = 0.0;       ///< area on shared surfaces / area of the smaller maplet, 0..1
  double chi2_per_dof = 0.0;  ///< of the matches, all of them alike
  double spread = 1.0;        ///< of the middle one of them: spread_of()
  double rms_m = 0.0;         ///< of the matches' offsets
  double worth = 0.0;         ///< of the matches: roots of areas, m, large ones alike
  std::uint32_t iterations = 0;
  Stop stop = Stop::kConverged;
  PlaneCode plane = PlaneCode::kSpace;  ///< both are held in, see hold_to()
};

/// A closure between two maplets, as aligned.
[[nodiscard]] DeltaPose closure_of(const MapletKey& a, Stamp stamp_a, const MapletKey& b,
                                   Stamp stamp_b, const MapletAlignment& alignment) noexcept;

/// Aligns the planes of two maplets: Iterative Closest Algebraic Plane.
///
/// Memory   fixed, inside the object (~300 KB): no heap.
/// Time     O(iterations * planes_a * planes_b); overruns by one iteration at most.
/// Threads  one caller at a time.
/// Math     docs/math/icap.md (paper: Algorithm 3, eq. 2-8).
class Icap {
 public:
  explicit Icap(const RegistrationConfig& config) noexcept : config_{config} {}

  /// @param guess  T_a_b within gate_m, gate_rad of the truth
  /// @return T_a_b with its covariance and the axes the planes leave free, or
  ///   kNoOverlap  fewer than config.min_matches pairs; planes that are not finite, or further away
  ///   than a maplet can be written with, are none
  ///   kBadInput   the guess is not finite
  [[nodiscard]] Expected<MapletAlignment> align(const Maplet& a, const Maplet& b,
                                                const Transform<MapletA, MapletB>& guess,
                                                Deadline deadline) noexcept {
    return align(a, b, guess, config_.gate_m, config_.gate_rad, deadline);
  }
  [[nodiscard]] Expected<MapletAlignment> align(const Maplet& a, const Maplet& b,
                                                const Transform<MapletA, MapletB>& guess,
                                                double gate_m, double gate_rad,
                                                Deadline deadline) noexcept;

  /// Planes outside of a region are left out from now on (paper: Algorithm 2).
  /// @param region  of a's frame, kept; nullptr: all planes
  void look_at(const RegionOfInterest* region) noexcept { region_ = region; }

  /// Both cameras move in one plane only, up being the same in both: three unknowns are left.
  void hold_to(const std::optional<PlanarMotion>& planar) noexcept { planar_ = planar; }

  /// Adds to the covariance what single pairs of the last align move, eq. 11e: for whoever is about
  /// to believe it.
  /// @return how many times less sure of the position it is then; 1: single pairs move nothing
  double doubt(MapletAlignment& alignment) const noexcept;

  /// The pairs of the last align.
  [[nodiscard]] std::span<const PlanePair> pairs() const noexcept { return pairs_.pairs(); }

 private:
  [[nodiscard]] bool start(const Maplet& a, const Maplet& b, Se3& T, double gate_m, double gate_rad,
                           Deadline deadline) noexcept;
  [[nodiscard]] bool improve(Se3& T, const Se3& guess, bool closed_form) noexcept;
  void solve_closed_form(Se3& T, const Se3& guess) const noexcept;
  [[nodiscard]] bool settle(Se3& T, const Se3& held, double& gate_m, double& gate_rad,
                            Deadline deadline, MapletAlignment& out) noexcept;
  [[nodiscard]] bool slide(const MapletAlignment& from, double reach_m, Se3& T,
                           Deadline deadline) noexcept;
  void conclude(const Se3& T, MapletAlignment& out) noexcept;

  RegistrationConfig config_;
  const RegionOfInterest* region_ = nullptr;
  std::optional<PlanarMotion> planar_;
  PlanePairs pairs_;
  bool kin_ = false;              ///< the two share keyframes, and their noise
  std::optional<Se3> T_started_;  ///< that the pairs are of, where votes chose the start by them
  PlaceDescriptor place_a_;
  PlaceDescriptor place_b_;
  PlaceCompare compare_;
};

}  // namespace maplet
