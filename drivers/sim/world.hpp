// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/geometry/plane.hpp"

namespace maplet::sim {

struct SimOptions;

/// What a surface looks like in the gray image.
enum class Material : std::uint8_t {
  kPlaster,
  kWallpaper,
  kCarpet,
  kTiles,
  kWood,
  kCardboard,
  kPoster
};
inline constexpr int kMaterials = 7;

/// A rectangle that is seen from one side only.
struct Surface {
  Eigen::Vector3d corner;   ///< world frame, m
  Eigen::Vector3d along;    ///< edge from the corner, m
  Eigen::Vector3d across;   ///< the other edge; n = along x across points to the side that is seen
  std::uint16_t plane = 0;  ///< id of its plane, from 1
  Material material = Material::kPlaster;
  float albedo = 0.7F;  ///< 0..1
  bool decal = false;   ///< covers an earlier surface of its plane
};

/// A point of the closed path; the curve stays inside the hull of four neighbours.
struct Knot {
  double x_m;
  double y_m;
  double z_m;
  double yaw_rad;  ///< unwrapped along the path; ignored when the camera looks where it goes
};

/// How the camera goes round in a world.
struct Route {
  std::vector<Knot> knots;  ///< a closed uniform cubic B-spline
  bool look_ahead = false;  ///< yaw follows the path's tangent
  double pitch_rad = 0.0;   ///< positive looks down
};

/// Where things are. World frame: z up, floor at z = 0, m.
///
/// Coplanar surfaces that face the same side are one plane, whatever object they belong to.
struct World {
  std::vector<Surface> surfaces;
  std::vector<Plane> planes;  ///< planes[id - 1], world frame, n to the seen side
  Route route;
};

/// Names of all worlds, for messages and help.
[[nodiscard]] std::string world_names();
[[nodiscard]] bool is_world(std::string_view name);

/// @param name one of world_names()
[[nodiscard]] World make_world(std::string_view name, const SimOptions& options);

}  // namespace maplet::sim
