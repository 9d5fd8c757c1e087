// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/plane_tangent.hpp"

namespace maplet {

Plane PlaneTangent::at(const Eigen::Vector3d& delta) const noexcept {
  const Eigen::Vector3d turned = (n + delta[0] * u + delta[1] * v).normalized();
  return {turned, delta[2] - turned.dot(centre)};
}

Eigen::Matrix3d PlaneTangent::change_to(const PlaneTangent& to) const noexcept {
  const Eigen::Vector3d step = to.centre - centre;
  Eigen::Matrix3d a;
  a << to.u.dot(u), to.u.dot(v), 0.0,  //
      to.v.dot(u), to.v.dot(v), 0.0,   //
      u.dot(step), v.dot(step), 1.0;
  return a;
}

Eigen::Matrix<double, 3, 6> PlaneTangent::jacobian_of_motion() const noexcept {
  Eigen::Matrix<double, 3, 6> j = Eigen::Matrix<double, 3, 6>::Zero();
  j.block<1, 3>(0, 3) = v.transpose();
  j.block<1, 3>(1, 3) = -u.transpose();
  j.block<1, 3>(2, 0) = -n.transpose();
  j.block<1, 3>(2, 3) = -centre.cross(n).transpose();
  return j;
}

Eigen::Matrix3d PlaneTangent::jacobian_of_theta(const Plane& plane) const noexcept {
  const double d = plane.d;
  const Eigen::Matrix3d dn = -d * (Eigen::Matrix3d::Identity() - plane.n * plane.n.transpose());
  Eigen::Matrix3d j;
  j.row(0) = u.transpose() * dn;
  j.row(1) = v.transpose() * dn;
  j.row(2) = centre.transpose() * dn + d * d * plane.n.transpose();
  return j;
}

}  // namespace maplet
