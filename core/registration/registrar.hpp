// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/maplet/builder.hpp"
#include "core/registration/config.hpp"
#include "core/registration/delta_pose.hpp"
#include "core/registration/icap.hpp"

namespace maplet {

/// How often which source decided a link. Counts since start-up.
struct RegistrarCounts {
  std::uint64_t links = 0;
  std::uint64_t odometry_alone = 0;  ///< too few planes in common, or none at all
  std::uint64_t contradicted = 0;    ///< planes and odometry exclude each other: odometry alone
  std::uint64_t with_free_axes = 0;  ///< odometry filled directions that the planes leave free
  std::uint64_t deadline_misses = 0;
};

/// Ties maplets to each other with delta-poses.
///
/// Memory   an Icap in the arena.
/// Threads  one
/// Math     docs/math/icap.md, section 5.
class Registrar {
 public:
  Registrar(const RegistrationConfig& config, Arena& arena);

  /// Consecutive maplets. Always gives a delta-pose: planes and odometry are fused without counting
  /// what they have in common twice; with no overlap it is the odometry's.
  /// @param odometry  of `current`, as MapletCut::link
  [[nodiscard]] DeltaPose link(const Maplet& previous, const Maplet& current,
                               const PathLink& odometry, Deadline deadline) noexcept;

  /// The camera moves in a plane only: links have three unknowns.
  void hold_to(const PlanarMotion& planar) noexcept {
    planar_ = planar;
    icap_->hold_to(planar);
  }

  /// How well the planes of the newest link's maplets fit (MapletAlignment::chi2_per_dof); NaN
  /// where they decided nothing.
  [[nodiscard]] double fit() const noexcept { return fit_; }
  [[nodiscard]] const RegistrarCounts& counts() const noexcept { return counts_; }

 private:
  [[nodiscard]] DeltaPose fuse(const Maplet& previous, const Maplet& current,
                               const PathLink& odometry, Deadline deadline) noexcept;

  RegistrationConfig config_;
  Arena::Owned<Icap> icap_;
  std::optional<PlanarMotion> planar_;
  RegistrarCounts counts_;
  double fit_ = std::numeric_limits<double>::quiet_NaN();
};

/// Fuses two estimates of one transform whose errors may be correlated in any way: covariance
/// intersection (Julier and Uhlmann 1997), the weight that makes the result's volume smallest.
///
/// @param information_y  may be zero along some axes
/// @return T with its covariance, tangent of its right frame
struct FusedTransform {
  Se3 T;
  Matrix6d covariance;
  double weight_y = 0.0;
};
[[nodiscard]] FusedTransform intersect(const Se3& x, const Matrix6d& covariance_x, const Se3& y,
                                       const Matrix6d& information_y) noexcept;

}  // namespace maplet
