// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <random>
#include <vector>

#include "core/skeleton/linearise.hpp"
#include "core/skeleton/pose_graph.hpp"

namespace maplet::test {

template <class Space>
struct Measurement {
  int a;
  int b;
  typename Space::Pose z;
  typename Space::Block information;
};

/// A walk with closures, measured with noise: every pose linked to the one before, many to one met
/// earlier nearby.
template <class Space>
struct RandomGraph {
  using Tangent = typename Space::Tangent;
  std::vector<typename Space::Pose> truth;
  std::vector<Measurement<Space>> measurements;

  RandomGraph(int nodes, double noise, unsigned seed) {
    std::mt19937 random{seed};
    std::normal_distribution<double> normal;
    const auto tangent = [&](double scale) {
      Tangent xi;
      for (int i = 0; i < Space::kDim; ++i) xi[i] = scale * normal(random);
      return xi;
    };
    const auto measure = [&](int a, int b) {
      const auto z = Space::retract(Space::between(truth[a], truth[b]), tangent(noise));
      measurements.push_back({a, b, z, Space::Block::Identity() / (noise * noise)});
    };
    truth.emplace_back();
    for (int i = 1; i < nodes; ++i) {
      Tangent step = tangent(0.2);
      step[0] += 1.0;
      truth.push_back(Space::compose(truth.back(), Space::retract({}, step)));
      measure(i - 1, i);
      if (i % 3 == 0 && i > 6) measure(static_cast<int>(random() % (i - 5)), i);
    }
  }
};

/// What the factor stands for: all factors as they were linearised, and the first node's anchor.
template <class Space>
Eigen::MatrixXd dense_hessian(const Graph<Space>& g) {
  constexpr int kDim = Space::kDim;
  const int n = kDim * g.node_count();
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < g.factor_end(); ++i) {
    const auto& f = g.factor(i);
    const auto blocks = hessian(f, f.rel_lin, f.weight_lin);
    h.template block<kDim, kDim>(kDim * f.a, kDim * f.a) += blocks.aa;
    h.template block<kDim, kDim>(kDim * f.b, kDim * f.b) += blocks.bb;
    h.template block<kDim, kDim>(kDim * f.b, kDim * f.a) += blocks.ba;
    h.template block<kDim, kDim>(kDim * f.a, kDim * f.b) += blocks.ba.transpose();
  }
  h.template topLeftCorner<kDim, kDim>() +=
      g.node(0).anchor * Eigen::MatrixXd::Identity(kDim, kDim);
  return h;
}

/// Large enough for what the tests build.
inline constexpr PoseGraphLimits kRoom{400, 1200, 40000};

}  // namespace maplet::test
