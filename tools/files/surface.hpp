// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/geometry/plane.hpp"
#include "core/geometry/se3.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet::files {

/// Cells of a plane that touch in a row: the parallelogram corner + s along + t across, s, t in
/// [0, 1]; along x across points where the plane's normal does.
struct Strip {
  Eigen::Vector3d corner;
  Eigen::Vector3d along;
  Eigen::Vector3d across;
};

/// One plane of a maplet with the places where it was seen, in any one frame.
struct Surface {
  Plane plane;
  double area_m2 = 0.0;
  float mean_gray = -1.0F;  ///< 0..255; negative when there is no gray image
  std::vector<Strip> strips;
};

/// The maplet's planes, its frame.
[[nodiscard]] std::vector<Surface> surfaces_of(const Maplet& maplet);

/// The same surface seen from a.
[[nodiscard]] Surface moved(const Se3& T_a_b, const Surface& b);

}  // namespace maplet::files
