// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/mapletctl/planar_option.hpp"

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
