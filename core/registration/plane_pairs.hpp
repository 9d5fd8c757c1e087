// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/base/static_vector.hpp"
#include "core/maplet/maplet.hpp"
#include "core/maplet/plane_tangent.hpp"
#include "core/registration/config.hpp"
#include "core/registration/region.hpp"

namespace maplet {

/// A plane of a maplet, ready for matching.
struct PlaneFeature {
  static constexpr std::size_t kSamples = 16;

  const MapletPlane* plane = nullptr;
  PlaneBasis basis{Plane{}, 0};
  PlaneTangent tangent;
  StaticVector<Eigen::Vector3d, kSamples> samples;  ///< spread over its occupied cells
  double radius_m = 0.0;                            ///< about its centre: no cell is further
};

/// The same surface in both maplets, as matched.
struct PlanePair {
  const PlaneFeature* a;
  const PlaneFeature* b;
  PlaneTangent tangent;    ///< a's frame, of a's plane, about the middle of what both saw
  Eigen::Matrix3d weight;  ///< inverse covariance of the residual
  double uneven_rad = 0.0;
  double share = 0.0;    ///< of the smaller plane's extent, seen by both
  double area_m2 = 0.0;  ///< seen by both
};

/// Finds pairs of planes under a transform: one to one, mutually nearest.
///
/// Memory   fixed, inside the object.
/// Math     docs/math/icap.md, eq. 1-4.
class PlanePairs {
 public:
  /// Reads both maplets; keeps pointers into them until the next call.
  /// @param region  of a's frame: planes outside are left out, b's where T_a_b puts them; or
  /// nullptr
  void prepare(const Maplet& a, const Maplet& b, const RegionOfInterest* region,
               const Se3& T_a_b) noexcept;

  /// @param gate_m, gate_rad  how far T_a_b may be from the truth
  void match(const Se3& T_a_b, double gate_m, double gate_rad,
             const RegistrationConfig& config) noexcept;

  [[nodiscard]] std::span<const PlanePair> pairs() const noexcept {
    return {pairs_.data(), pairs_.size()};
  }
  /// How much the pairs say together: large ones count alike.
  [[nodiscard]] double worth() const noexcept;
  /// Area on surfaces that both have: of the pairs, and of planes that are another part of a pair's
  /// surface (one to one keeps one part of what either maplet has in pieces).
  [[nodiscard]] double shared_m2() const noexcept;
  [[nodiscard]] double area_a_m2() const noexcept { return area_a_m2_; }
  [[nodiscard]] double area_b_m2() const noexcept { return area_b_m2_; }

 private:
  struct Best {
    std::int16_t other = -1;
    double cost = 0.0;
    double share = 0.0;
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // a's frame
  };

  // A plane of b in a's frame, as the present transform has it.
  struct Moved {
    Plane plane;
    PlaneBasis basis{Plane{}, 0};
    StaticVector<Eigen::Vector3d, PlaneFeature::kSamples> samples;
  };
  void move_b(const PlaneFeature& b, const Eigen::Matrix3d& R, const Eigen::Vector3d& t) noexcept;
  void consider(std::size_t ia, std::size_t ib, double gate_m, double gate_rad,
                const RegistrationConfig& config) noexcept;

  const Maplet* maplet_a_ = nullptr;
  const Maplet* maplet_b_ = nullptr;
  StaticVector<PlaneFeature, kMaxMapletPlanes> a_;
  StaticVector<PlaneFeature, kMaxMapletPlanes> b_;
  Moved moved_b_;  // the one that is being considered
  std::array<Best, kMaxMapletPlanes> best_of_a_;
  std::array<Best, kMaxMapletPlanes> best_of_b_;
  StaticVector<PlanePair, kMaxMapletPlanes> pairs_;
  double area_a_m2_ = 0.0;
  double area_b_m2_ = 0.0;
};

}  // namespace maplet
