// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/covariance_code.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr double kShapeUnit = 32000.0;  // rounding may lead a little beyond 1
constexpr double kShapeMax = 1.02;
constexpr double kPivotUnit = 4096.0;
constexpr double kEigenMin = 0x1p-24;  // of the correlations: a pivot is at least 2^-12 of its row
constexpr double kPivotMaxSteps = 14 * kPivotUnit;

double clamp_sigma(double sigma) noexcept {
  return std::clamp(sigma, CovarianceCode::kSigmaMin, CovarianceCode::kSigmaMax);
}

/// Eleven significant bits: sixteen with the exponent on the radio.
float round_sigma(double sigma) noexcept {
  int exponent = 0;
  const double mantissa = std::frexp(clamp_sigma(sigma), &exponent);
  return static_cast<float>(std::ldexp(std::nearbyint(mantissa * 0x1p11), exponent - 11));
}

/// Correlations whose smallest eigenvalue is at least kEigenMin: what is too tight, or negative, is
/// widened, the diagonal with it. eq. 1
Matrix6d widened_correlations(const Matrix6d& covariance, const Vector6d& sigma) noexcept {
  Matrix6d R = Matrix6d::Identity();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < i; ++j) {
      const double scale = std::sqrt(covariance(i, i)) * std::sqrt(covariance(j, j));
      R(i, j) = scale > 0.0 ? std::clamp(covariance(i, j) / scale, -1.0, 1.0) : 0.0;
      R(j, i) = R(i, j);
    }
  }
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen{R};
  if (eigen.eigenvalues().minCoeff() < kEigenMin) {
    R = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(kEigenMin).asDiagonal() *
        eigen.eigenvectors().transpose();
  }
  return sigma.asDiagonal() * R * sigma.asDiagonal();
}

}  // namespace

Expected<CovarianceCode> encode_covariance(const Matrix6d& covariance) noexcept {
  if (!covariance.allFinite()) return fail(ErrorCode::kBadInput, "covariance is not finite");
  if (covariance.diagonal().minCoeff() < 0.0) {
    return fail(ErrorCode::kBadInput, "a variance is negative");
  }
  Vector6d sigma = covariance.diagonal().cwiseSqrt();
  for (double& s : sigma) s = clamp_sigma(s);
  const Matrix6d L = widened_correlations(covariance, sigma).llt().matrixL();
  CovarianceCode code;
  std::array<double, 6> column{};  // eq. 3: what rounding the pivot did to its column
  std::size_t shape = 0;
  for (int i = 0; i < 6; ++i) {
    code.sigma[i] = round_sigma(L.row(i).norm());
    const double row = 1.0 / code.sigma[i];
    for (int j = 0; j < i; ++j) {
      const double unit = std::clamp(L(i, j) * row * column[j], -kShapeMax, kShapeMax);
      code.shape[shape++] = static_cast<std::int16_t>(std::nearbyint(unit * kShapeUnit));
    }
    const double pivot = L(i, i) * row;
    if (i == 0) {
      column[0] = 1.0 / pivot;
      continue;
    }
    const double steps = std::nearbyint(-kPivotUnit * std::log2(pivot));
    code.pivot[i - 1] = static_cast<std::uint16_t>(std::clamp(steps, 0.0, kPivotMaxSteps));
    column[i] = std::exp2(code.pivot[i - 1] / -kPivotUnit) / pivot;
  }
  return code;
}

Matrix6d decode_covariance(const CovarianceCode& code) noexcept {
  Matrix6d L = Matrix6d::Zero();
  std::size_t shape = 0;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < i; ++j) L(i, j) = code.sigma[i] * (code.shape[shape++] / kShapeUnit);
    L(i, i) = code.sigma[i] * (i == 0 ? 1.0 : std::exp2(code.pivot[i - 1] / -kPivotUnit));
  }
  Matrix6d covariance;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) {
      double sum = 0.0;
      for (int k = 0; k <= j; ++k) sum += L(i, k) * L(j, k);
      covariance(i, j) = sum;
      covariance(j, i) = sum;
    }
  }
  return covariance;
}

bool valid(const CovarianceCode& code) noexcept {
  const auto in_range = [](float sigma) {
    return sigma >= CovarianceCode::kSigmaMin && sigma <= CovarianceCode::kSigmaMax &&
           round_sigma(sigma) == sigma;
  };
  return std::all_of(code.sigma.begin(), code.sigma.end(), in_range) &&
         std::all_of(code.shape.begin(), code.shape.end(),
                     [](std::int16_t s) { return std::abs(s) <= kShapeMax * kShapeUnit; }) &&
         std::all_of(code.pivot.begin(), code.pivot.end(),
                     [](std::uint16_t p) { return p <= kPivotMaxSteps; });
}

}  // namespace maplet
