// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/pose_information.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr double kPin = 1e4;       // information along free axes, per squared scale
constexpr double kSpurious = 2.0;  // information must exceed that of noisy normals by this factor
// The regions' disagreement is itself noisy: it is drawn towards its own mean over all directions
// as if that had been seen in this many regions.
constexpr double kShrinkBlocks = 12.0;
constexpr double kLeastInflation = 0.05;
constexpr double kMostYielded = 0.5;
constexpr double kNull = 1e-6;  // eigenvalues below are the null space of a projection

}  // namespace

Whitening::Whitening(const Matrix6d& claimed, const Vector6d& scale) noexcept {
  const Matrix6d scaled = scale.asDiagonal() * claimed * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen{scaled};
  for (int i = 5; i >= 0; --i) {
    const double value = eigen.eigenvalues()[i];
    if (!(value > kNull * std::max(1.0, eigen.eigenvalues()[5]))) break;
    basis.col(kept++) = scale.cwiseProduct(eigen.eigenvectors().col(i)) / std::sqrt(value);
  }
}

KnownDirections known_directions(const Matrix6d& information, const Vector6d& gradient,
                                 const Matrix6d& spurious, const Vector6d& scale) noexcept {
  const Matrix6d scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Matrix6d noise = scale.asDiagonal() * spurious * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen{scaled};
  KnownDirections known;
  Matrix6d kept = Matrix6d::Identity();
  for (int i = 0; i < 6; ++i) {
    const Vector6d axis = eigen.eigenvectors().col(i);
    const double from_noise = kSpurious * axis.dot(noise * axis);
    if (eigen.eigenvalues()[i] - from_noise >= 1.0) continue;
    kept -= axis * axis.transpose();
    known.free_axes.push_back(scale.cwiseProduct(axis).normalized());
  }
  const Vector6d inverse = scale.cwiseInverse();
  known.information = inverse.asDiagonal() * (kept * scaled * kept) * inverse.asDiagonal();
  known.gradient = inverse.asDiagonal() * (kept * (scale.asDiagonal() * gradient));
  // The axes themselves are a little noisy: with a weak prior alone, what they leak would be
  // followed.
  known.pin = kPin * (inverse.asDiagonal() * (Matrix6d::Identity() - kept) * inverse.asDiagonal());
  return known;
}

Matrix6d ScoreBlocks::calibrate(const Matrix6d& claimed, const Vector6d& scale) const noexcept {
  const Whitening white{claimed, scale};
  if (white.kept == 0) return claimed;
  Matrix6d spread = Matrix6d::Zero();
  double blocks = 0.0;
  for (std::size_t i = 0; i < sums_.size(); ++i) {
    if (!used_[i]) continue;
    const Vector6d y = white.basis.transpose() * sums_[i];
    spread += y * y.transpose();
    blocks += 1.0;
  }
  // Few regions, of which the pose has used up some freedom.
  const double rest = std::max(1.0, blocks - white.kept);
  spread *= blocks / rest;
  const double mean = std::max(kLeastInflation, spread.trace() / white.kept);
  Matrix6d drawn =
      (blocks * spread + kShrinkBlocks * mean * Matrix6d::Identity()) / (blocks + kShrinkBlocks);
  drawn.diagonal().array() += kLeastInflation;
  // Outside of what is kept the basis is zero, and so is the result.
  Matrix6d root = Matrix6d::Zero();  // maps whitened to information: eigenvector * sqrt(value)
  for (int i = 0; i < white.kept; ++i) {
    const Vector6d u = white.basis.col(i).cwiseQuotient(scale);  // eigenvector / sqrt(value)
    root.col(i) = u.cwiseQuotient(scale) / u.squaredNorm();
  }
  const Matrix6d yielded = yielded_.selfadjointView<Eigen::Lower>();
  // Eq. 14a: what the scores answer to a shift is less than what they claim.
  const double lost = (white.basis.transpose() * yielded * white.basis).trace() / white.kept;
  const double left = 1.0 - std::min(kMostYielded, lost);
  const Matrix6d out = left * left * (root * drawn.inverse() * root.transpose());
  return 0.5 * (out + out.transpose());
}

double ScoreBlocks::inflation(const Matrix6d& claimed, const Vector6d& scale) const noexcept {
  const Whitening white{claimed, scale};
  if (white.kept == 0) return 1.0;
  double sum = 0.0;
  double blocks = 0.0;
  for (std::size_t i = 0; i < sums_.size(); ++i) {
    if (!used_[i]) continue;
    sum += (white.basis.transpose() * sums_[i]).squaredNorm();
    blocks += 1.0;
  }
  const double rest = std::max(1.0, blocks - white.kept);
  return std::max(kLeastInflation, sum / white.kept * blocks / rest);
}

}  // namespace maplet
