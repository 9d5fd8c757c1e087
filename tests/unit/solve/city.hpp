// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "tools/solve/graph_file.hpp"

namespace maplet::graphs {

inline Edge planar_edge(std::uint64_t a, std::uint64_t b, double x, double y, double theta,
                        double information = 100.0) {
  Edge e;
  e.a = a;
  e.b = b;
  e.z.t = {x, y, 0.0};
  e.z.q = Eigen::Quaterniond{std::cos(0.5 * theta), 0.0, 0.0, std::sin(0.5 * theta)};
  e.information(0, 0) = e.information(1, 1) = e.information(5, 5) = information;
  return e;
}

/// A walk along the streets of a city of square blocks, with a closure wherever it comes by a place
/// again.
inline GraphFile city(int poses, int size, double sigma, unsigned seed) {
  GraphFile graph;
  graph.planar = true;
  std::mt19937 random{seed};
  std::normal_distribution<double> noise{0.0, sigma};
  struct At {
    int x, y, heading;
  };
  std::vector<At> walk{{0, 0, 0}};
  std::map<std::pair<int, int>, std::vector<int>> been;
  const std::array<std::pair<int, int>, 4> ahead{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};
  const auto measure = [&](int a, int b) {
    const double turn = walk[a].heading * M_PI / 2.0;
    const double dx = walk[b].x - walk[a].x;
    const double dy = walk[b].y - walk[a].y;
    const std::array<double, 3> off{noise(random), noise(random), noise(random)};
    graph.edges.push_back(planar_edge(a, b, std::cos(turn) * dx + std::sin(turn) * dy + off[2],
                                      std::cos(turn) * dy - std::sin(turn) * dx + off[1],
                                      (walk[b].heading - walk[a].heading) * M_PI / 2.0 + off[0],
                                      1.0 / (sigma * sigma)));
  };
  been[{0, 0}].push_back(0);
  for (int i = 1; i < poses; ++i) {
    At at = walk.back();
    for (int tries = 0; tries < 20; ++tries) {
      const int turn = at.x % 5 == 0 && at.y % 5 == 0 ? static_cast<int>(random() % 4) : 0;
      const int heading = (at.heading + turn) % 4;
      const int x = at.x + ahead[heading].first;
      const int y = at.y + ahead[heading].second;
      if (std::abs(x) > size || std::abs(y) > size) {
        at.heading = (at.heading + 2) % 4;
        continue;
      }
      at = {x, y, heading};
      break;
    }
    walk.push_back(at);
    measure(i - 1, i);
    auto& here = been[{at.x, at.y}];
    if (!here.empty() && i - here.back() > 20) measure(here[random() % here.size()], i);
    here.push_back(i);
    Se3& truth = graph.truth[static_cast<std::uint64_t>(i)];
    truth.t = {static_cast<double>(at.x), static_cast<double>(at.y), 0.0};
    const double half_turn = at.heading * M_PI / 4.0;
    truth.q = {std::cos(half_turn), 0.0, 0.0, std::sin(half_turn)};
  }
  return graph;
}

}  // namespace maplet::graphs
