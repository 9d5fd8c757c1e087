// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/level.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>
#include <vector>

namespace maplet::draw {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using files::Surface;

constexpr double kCosHint = 0.70;    // 45 deg
constexpr double kCosAcross = 0.99;  // 8 deg
constexpr double kSinAlong = 0.14;   // 8 deg
constexpr double kWallWeight = 0.5;
constexpr std::size_t kLargest = 200;
constexpr std::size_t kLargestWalls = 24;

[[nodiscard]] double support(std::span<const Surface> surfaces, const Vector3d& up) {
  double area_m2 = 0.0;
  for (const Surface& surface : surfaces) {
    const double cosine = std::abs(surface.plane.n.dot(up));
    if (cosine > kCosAcross) area_m2 += surface.area_m2;
    if (cosine < kSinAlong) area_m2 += kWallWeight * surface.area_m2;
  }
  return area_m2;
}

/// Normals, and what is upright to two walls.
[[nodiscard]] std::vector<Vector3d> candidates(std::span<const Surface> surfaces,
                                               const Vector3d& hint) {
  std::vector<std::size_t> order(surfaces.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, std::greater{},
                           [&](std::size_t i) { return surfaces[i].area_m2; });
  std::vector<Vector3d> out;
  const auto consider = [&](Vector3d direction) {
    if (direction.dot(hint) < 0.0) direction = -direction;
    if (direction.dot(hint) > kCosHint) out.push_back(direction);
  };
  for (std::size_t i = 0; i < std::min(order.size(), kLargest); ++i) {
    consider(surfaces[order[i]].plane.n);
    for (std::size_t j = 0; j < i && i < kLargestWalls; ++j) {
      const Vector3d cross = surfaces[order[i]].plane.n.cross(surfaces[order[j]].plane.n);
      if (cross.norm() > 0.5) consider(cross.normalized());
    }
  }
  return out;
}

/// The direction that surfaces near enough to `up` lie across or along, by least squares.
[[nodiscard]] Vector3d refined(std::span<const Surface> surfaces, const Vector3d& up) {
  Matrix3d moment = Matrix3d::Zero();
  for (const Surface& surface : surfaces) {
    const Vector3d& n = surface.plane.n;
    const double cosine = std::abs(n.dot(up));
    if (cosine > kCosAcross) moment += surface.area_m2 * n * n.transpose();
    if (cosine < kSinAlong) moment -= kWallWeight * surface.area_m2 * n * n.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver{moment};
  const Vector3d best = solver.eigenvectors().col(2);
  // Walls of one direction alone leave a whole plane of answers: stay with the candidate.
  const double spread = solver.eigenvalues()[2] - solver.eigenvalues()[1];
  if (spread < 0.02 * moment.norm() || std::abs(best.dot(up)) < kCosAcross) return up;
  return best.dot(up) < 0.0 ? Vector3d{-best} : best;
}

}  // namespace

Vector3d find_up(std::span<const Surface> surfaces, const Vector3d& hint) {
  Vector3d up = hint;
  double most_m2 = support(surfaces, up);
  for (const Vector3d& candidate : candidates(surfaces, hint)) {
    const double area_m2 = support(surfaces, candidate);
    if (area_m2 > most_m2 * (1.0 + 1e-9)) {
      most_m2 = area_m2;
      up = candidate;
    }
  }
  if (most_m2 == 0.0) return hint;
  for (int i = 0; i < 3; ++i) up = refined(surfaces, up);
  return up;
}

Matrix3d lay_out(std::span<const Surface> surfaces, const Vector3d& up, const Vector3d& forward) {
  Vector3d right = Vector3d::UnitX() - up * up.x();
  if (right.norm() < 0.3) right = Vector3d::UnitZ() - up * up.z();
  right.normalize();
  const Vector3d top = up.cross(right);
  // Walls mostly stand at right angles: the mean of their directions, four to a turn.
  std::complex<double> mean{0.0, 0.0};
  for (const Surface& surface : surfaces) {
    const Vector3d& n = surface.plane.n;
    if (std::abs(n.dot(up)) > 0.3) continue;
    mean += std::polar(surface.area_m2, 4.0 * std::atan2(n.dot(top), n.dot(right)));
  }
  double angle = mean == 0.0 ? 0.0 : std::arg(mean) / 4.0;
  double best = -2.0;
  for (int quarter = 0; quarter < 4; ++quarter) {
    const double a = std::arg(mean) / 4.0 + quarter * std::numbers::pi / 2.0;
    const double looks_up = forward.dot(-std::sin(a) * right + std::cos(a) * top);
    if (looks_up > best + 1e-6) {
      best = looks_up;
      angle = a;
    }
  }
  Matrix3d axes;
  axes.row(0) = std::cos(angle) * right + std::sin(angle) * top;
  axes.row(1) = -std::sin(angle) * right + std::cos(angle) * top;
  axes.row(2) = up;
  return axes;
}

}  // namespace maplet::draw
