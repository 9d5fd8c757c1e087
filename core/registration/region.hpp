// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/maplet/maplet.hpp"
#include "core/registration/fixed_list.hpp"

namespace maplet {

/// A convex polygon on a ground plan: which planes a registration looks at (paper: the ROI of
/// Algorithm 2, section III-B).
///
/// Memory  fixed, a value.
/// Units   m; the frame is that of the maplet it was made for.
struct RegionOfInterest {
  static constexpr std::size_t kCorners = 16;

  Eigen::Vector3d x = Eigen::Vector3d::UnitX();  ///< axes of the ground plan
  Eigen::Vector3d y = Eigen::Vector3d::UnitZ();
  FixedList<Eigen::Vector2d, kCorners> corners;  ///< anticlockwise; none: contains everything

  [[nodiscard]] Eigen::Vector2d plan(const Eigen::Vector3d& p) const noexcept {
    return {x.dot(p), y.dot(p)};
  }
  [[nodiscard]] bool contains(const Eigen::Vector3d& p) const noexcept;
  /// Whether a plane has its middle or a corner of its extent inside.
  /// @param T  maps the plane's maplet into the region's frame
  [[nodiscard]] bool touches(const Maplet& maplet, const MapletPlane& plane,
                             const Se3& T) const noexcept;
};

/// A border beyond which nothing is mapped: where a surface's extent ends in the open.
struct Frontier {
  std::uint32_t cells = 0;  ///< border cells with nothing beside them
  RegionOfInterest region;  ///< around them, kMargin_m wider; no corners when there are none

  static constexpr double kMargin_m = 1.0;
};

/// Unit: maplet.up, or the normal of the largest plane when that is not known; y of the camera in a
/// maplet without planes.
[[nodiscard]] Eigen::Vector3d up_of(const Maplet& maplet) noexcept;

/// Border cells of all planes whose neighbour lies on no plane, and the region around them on the
/// plan perpendicular to `up`.
/// @param up  unit, as up_of()
/// Time   O(cells + border cells * planes)
/// Math   docs/math/icap.md, eq. 19
[[nodiscard]] Frontier find_frontier(const Maplet& maplet, const Eigen::Vector3d& up) noexcept;

}  // namespace maplet
