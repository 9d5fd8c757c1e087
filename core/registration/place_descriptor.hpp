// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/maplet/maplet.hpp"
#include "core/registration/fixed_list.hpp"

namespace maplet {

/// A plane as the place index remembers it: where it lies and the rectangle around its extent.
struct PlacePlane {
  Eigen::Vector3f n, u;    ///< u: first axis of the rectangle, n x u the second
  Eigen::Vector3f centre;  ///< of the rectangle
  float half_u_m = 0.0F;
  float half_v_m = 0.0F;
  float weight = 0.0F;  ///< what it counts for: the root of its area, large ones alike

  [[nodiscard]] float distance(const Eigen::Vector3f& p) const noexcept {
    return n.dot(p - centre);
  }
};

/// A direction that many planes of a maplet are perpendicular to, and where they cut it.
struct PlaceAxis {
  static constexpr std::size_t kMarks = 20;
  /// One plane's, in four bytes: an index holds many of them.
  class Mark {
   public:
    Mark() noexcept = default;
    /// @param at_m  along the direction, within 130 m
    /// @param weight  0..1.27
    /// @param ahead  its normal goes along the direction, not against it
    Mark(float at_m, float weight, bool ahead) noexcept
        : at_{static_cast<std::int16_t>(std::lround(at_m / kStep_m))},
          weight_{static_cast<std::uint8_t>(weight / kWeight + 0.5F)},
          ahead_{ahead} {}
    [[nodiscard]] float at_m() const noexcept { return kStep_m * static_cast<float>(at_); }
    [[nodiscard]] float weight() const noexcept { return kWeight * static_cast<float>(weight_); }
    [[nodiscard]] bool ahead() const noexcept { return ahead_; }

   private:
    static constexpr float kStep_m = 0.004F;
    static constexpr float kWeight = 0.005F;
    std::int16_t at_ = 0;
    std::uint8_t weight_ = 0;
    bool ahead_ = false;
  };

  Eigen::Vector3f direction;
  float weight = 0.0F;  ///< of its marks
  FixedList<Mark, kMarks> marks;
};

/// The arrangement of a maplet's planes, small enough to keep a thousand of: what is compared when
/// nothing is known about how two maplets lie to each other.
///
/// Memory   fixed, ~3 KB.
/// Math     docs/math/icap.md, section 7.
struct PlaceDescriptor {
  static constexpr std::size_t kPlanes = 40;
  static constexpr std::size_t kAxes = 4;

  MapletKey key;
  Eigen::Vector3f up = Eigen::Vector3f::Zero();  ///< zero: not known
  float weight = 0.0F;                           ///< of all planes
  FixedList<PlacePlane, kPlanes> planes;         ///< the weightiest first
  FixedList<PlaceAxis, kAxes> axes;              ///< the weightiest first

  static void describe(const Maplet& maplet, PlaceDescriptor& out) noexcept;
};

}  // namespace maplet
