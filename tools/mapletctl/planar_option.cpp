// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/mapletctl/planar_option.hpp"

#include <fmt/format.h>

#include <cmath>

#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {

using Json = nlohmann::ordered_json;

PlanarMotion plane_of(const Maplet& maplet, const std::string& name) {
  if (maplet.up.isZero()) {
    throw Failure{name +
                  " does not say which way is up: map again with body.up, or without "
                  "--planar"};
  }
  return PlanarMotion{maplet.up};
}

void check_one_plane(const PlanarMotion& plane, const Maplet& other, const std::string& name) {
  constexpr double kOnePlane_rad = 0.05;
  const Eigen::Vector3d up = plane_of(other, name).up();
  const double apart_rad = std::atan2(plane.up().cross(up).norm(), plane.up().dot(up));
  if (apart_rad > kOnePlane_rad) {
    throw Failure{fmt::format(
        "{}: its camera is tilted by {:.1f} deg against the other's: leave --planar out", name,
        apart_rad * 57.29577951308232)};
  }
}

Json planar_json(const MapletAlignment& alignment) {
  const PlanarMotion planar{alignment.plane};
  const Eigen::Vector3d delta = planar.coordinates(alignment.T_a_b.se3);
  const Eigen::Matrix3d covariance =
      planar.basis().transpose() * alignment.covariance * planar.basis();
  Json out;
  for (const double x : planar.up()) out["up"].push_back(x);
  for (const double x : delta) out["delta"].push_back(x);
  for (const double x : covariance.reshaped()) out["covariance"].push_back(x);
  return out;
}

}  // namespace maplet::ctl
