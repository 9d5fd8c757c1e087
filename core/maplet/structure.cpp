// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/structure.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace maplet {

double structure_of(const PatchSet& set) noexcept {
  constexpr double kWall_m2 = 1.0;
  double detail = 0.0;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const FramePlane& p : set.planes) {
    const double root = std::sqrt(std::min<double>(p.area_m2, kWall_m2));
    const Eigen::Vector3d n = p.plane().n;
    scatter += root * n * n.transpose();
    if (p.area_m2 < kWall_m2) detail += root;
  }
  const double total = scatter.trace();
  if (total <= 0.0) return 0.0;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen{scatter, Eigen::EigenvaluesOnly};
  return detail * std::min(1.0, 9.0 * eigen.eigenvalues()[0] / total);
}

}  // namespace maplet
