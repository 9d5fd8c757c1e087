// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/observability.hpp"

#include <Eigen/Eigenvalues>

namespace maplet {

Observability Observability::of(const Matrix6d& raw, const Matrix6d& spurious,
                                const Eigen::Vector3d& pivot, double free_sigma) noexcept {
  // xi_b = to_b xi_p, the pivot's frame being b's moved to the pivot.
  const Matrix6d to_b = Se3{Eigen::Quaterniond::Identity(), pivot}.adjoint();
  const Matrix6d to_pivot = Se3{Eigen::Quaterniond::Identity(), -pivot}.adjoint();
  const Matrix6d at_pivot = to_b.transpose() * raw * to_b;
  const Matrix6d noise = to_b.transpose() * spurious * to_b;
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen{at_pivot};

  Observability out;
  const double least = 1.0 / (free_sigma * free_sigma);
  for (int i = 0; i < 6; ++i) {
    const Vector6d axis = eigen.eigenvectors().col(i);
    const double by_noise = axis.dot(noise * axis);
    const double value = eigen.eigenvalues()[i];
    const Vector6d axis_b = to_b * axis;                  // a motion
    const Vector6d form_b = to_pivot.transpose() * axis;  // what measures it
    if (value < least || value < 3.0 * by_noise) {        // eq. 10
      out.free_axes.push_back(axis_b.normalized());
      out.free_covariance += kFreeSigma * kFreeSigma * axis_b * axis_b.transpose();
      continue;
    }
    out.information += (value - by_noise) * form_b * form_b.transpose();
    out.covariance += axis_b * axis_b.transpose() / (value - by_noise);  // eq. 11
    out.step_inverse += axis_b * axis_b.transpose() / value;
  }
  return out;
}

}  // namespace maplet
