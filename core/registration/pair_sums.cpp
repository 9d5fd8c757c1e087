// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/pair_sums.hpp"

#include <Eigen/Cholesky>

namespace maplet {

namespace {

constexpr double kMostLeverage = 2.7;  // of 3: its own residual says nothing then
constexpr double kMiddleChi2 = 2.37;   // of three numbers
constexpr double kLeastSpread = 0.1;
constexpr std::size_t kFewPairs = 5;  // fewer have no middle

// eq. 6: its derivative by xi in T exp(xi).
Eigen::Matrix<double, 3, 6> jacobian(const PlanePair& pair, const Se3& T) noexcept {
  PlaneTangent at_b = pair.tangent.moved(T.inverse());
  at_b.n = pair.b->plane->plane.n;
  Eigen::Matrix<double, 3, 6> j = Eigen::Matrix<double, 3, 6>::Zero();
  j.block<1, 3>(0, 3) = at_b.n.cross(at_b.u).transpose();
  j.block<1, 3>(1, 3) = at_b.n.cross(at_b.v).transpose();
  j.block<1, 3>(2, 0) = -at_b.n.transpose();
  j.block<1, 3>(2, 3) = at_b.n.cross(at_b.centre).transpose();
  return j;
}

}  // namespace

Eigen::Vector3d residual(const PlanePair& pair, const Se3& T) noexcept {
  return pair.tangent.of(T * pair.b->plane->plane);
}

double spread_of(std::span<const PlanePair> pairs, const Se3& T) noexcept {
  if (pairs.size() < kFewPairs) return 1.0;
  StaticVector<double, kMaxMapletPlanes> all;
  for (const PlanePair& pair : pairs) {
    const Eigen::Vector3d r = residual(pair, T);
    all.push_back(r.dot(pair.weight * r));
  }
  const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
  std::nth_element(all.begin(), middle, all.end());
  return std::clamp(*middle / kMiddleChi2, kLeastSpread, 1.0);
}

PairSums PairSums::of(std::span<const PlanePair> pairs, const Se3& T) noexcept {
  PairSums sums;
  const double spread = spread_of(pairs, T);
  const Se3 T_inverse = T.inverse();
  for (const PlanePair& pair : pairs) {
    const Eigen::Vector3d r = residual(pair, T);
    const Eigen::Matrix<double, 3, 6> j = jacobian(pair, T);
    const double chi2 = r.dot(pair.weight * r);
    const Eigen::Matrix3d w = robust_weight(chi2 / spread) * pair.weight;
    sums.information += j.transpose() * w * j;
    sums.gradient += j.transpose() * (w * r);
    sums.chi2 += robust_weight(chi2) * chi2;
    sums.squares_m2 += r[2] * r[2];
    sums.pivot += T_inverse * pair.tangent.centre;
    // eq. 9: an offset that is measured along a wrong normal.
    const Eigen::Vector3d u = T_inverse.q * pair.tangent.u;
    const Eigen::Vector3d v = T_inverse.q * pair.tangent.v;
    const double uneven = pair.uneven_rad * pair.uneven_rad;
    const Eigen::Matrix3d& cb = pair.b->plane->covariance;
    sums.spurious.topLeftCorner<3, 3>() += w(2, 2) * ((cb(0, 0) + uneven) * u * u.transpose() +
                                                      (cb(1, 1) + uneven) * v * v.transpose());
  }
  sums.pivot /= std::max<double>(1.0, static_cast<double>(pairs.size()));
  return sums;
}

void PairSums::restrict_to(const PlanarMotion& planar) noexcept {
  const Matrix6d inside = planar.basis() * planar.basis().transpose();
  information = planar.restrict_information(information);
  spurious = inside * spurious * inside;
  gradient = inside * gradient;
}

Matrix6d leave_one_out(std::span<const PlanePair> pairs, const Se3& T,
                       double free_sigma_m) noexcept {
  const double spread = spread_of(pairs, T);
  const PairSums all = PairSums::of(pairs, T);
  // About the pivot, so that metres and radians compare; what nothing holds stays.
  const Matrix6d to_b = Se3{Eigen::Quaterniond::Identity(), all.pivot}.adjoint();
  const Matrix6d held = Matrix6d::Identity() / (free_sigma_m * free_sigma_m);
  const Matrix6d information = to_b.transpose() * all.information * to_b + held;
  const Vector6d gradient = to_b.transpose() * all.gradient;
  Matrix6d out = Matrix6d::Zero();
  for (const PlanePair& pair : pairs) {
    const Eigen::Vector3d r = residual(pair, T);
    const Eigen::Matrix<double, 3, 6> j = jacobian(pair, T) * to_b;
    const Eigen::Matrix3d w = robust_weight(r.dot(pair.weight * r) / spread) * pair.weight;
    const Matrix6d without = information - j.transpose() * w * j;
    const Vector6d step = without.ldlt().solve(gradient - j.transpose() * (w * r));
    out += step * step.transpose();
  }
  return to_b * out * to_b.transpose();
}

double leverage_chi2(std::span<const PlanePair> pairs, const Se3& T,
                     const Matrix6d& covariance) noexcept {
  const double spread = spread_of(pairs, T);
  double sum = 0.0;
  double total = 0.0;
  for (const PlanePair& pair : pairs) {
    const Eigen::Vector3d r = residual(pair, T);
    const Eigen::Matrix<double, 3, 6> j = jacobian(pair, T);
    const double chi2 = r.dot(pair.weight * r);
    const double robust = robust_weight(chi2 / spread);
    const double leverage =
        std::min(kMostLeverage, (robust * pair.weight * j * covariance * j.transpose()).trace());
    sum += leverage * robust * chi2 / (3.0 - leverage);  // eq. 11a
    total += leverage;
  }
  return sum / std::max(1e-9, total);
}

}  // namespace maplet
