// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <random>

#include "core/registration/delta_pose.hpp"

namespace maplet::test {

/// L L^T with standard deviations of millimetres and, when `free_sigma` > 0, one skew direction
/// that the scene leaves free.
inline Matrix6d random_covariance(std::mt19937& rng, double free_sigma = 0.0) {
  std::normal_distribution<double> normal;
  Matrix6d L = Matrix6d::Zero();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) L(i, j) = 1e-3 * normal(rng);
    L(i, i) = 1e-3 * (0.5 + std::abs(normal(rng)));
  }
  Vector6d axis;
  for (int i = 0; i < 6; ++i) axis[i] = normal(rng);
  axis.normalize();
  return L * L.transpose() + free_sigma * free_sigma * axis * axis.transpose();
}

/// A plausible delta-pose of maplets `id` and `id + 1`.
inline DeltaPose random_delta(std::mt19937& rng, std::uint16_t agent = 1, std::uint32_t epoch = 7,
                              std::uint32_t id = 0) {
  std::uniform_real_distribution<double> unit{-1.0, 1.0};
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi[i] = 1.5 * unit(rng);
  DeltaPose delta;
  delta.a = {agent, epoch, id};
  delta.b = {agent, epoch, id + 1};
  delta.stamp_a = Stamp{1305031102175304000 + std::int64_t{id} * 1'033'000'000};
  delta.stamp_b = delta.stamp_a + Stamp{1'033'000'000};
  delta.T_a_b.se3 = Se3::exp(xi);
  delta.covariance = random_covariance(rng);
  delta.overlap = static_cast<float>(0.5 + 0.5 * unit(rng));
  delta.matches = static_cast<std::uint16_t>(12 + 10 * unit(rng));
  return delta;
}

}  // namespace maplet::test
