// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <random>
#include <vector>

#include "tests/support/maplets.hpp"

namespace maplet::test {

/// A room of its own for each seed: sizes, and eight boxes that stand about. World z up, origin in
/// the middle of the floor.
inline std::vector<Wall> furnished(unsigned seed) {
  using V = Eigen::Vector3d;
  std::mt19937 rng{seed};
  std::uniform_real_distribution<double> unit{0.0, 1.0};
  const double w = 2.5 + unit(rng);
  const double d = 2.0 + unit(rng);
  std::vector<Wall> walls{{V{0, 0, 0}, V{w, 0, 0}, V{0, d, 0}},
                          {V{-w, 0, 1.3}, V{0, d, 0}, V{0, 0, 1.3}},
                          {V{w, 0, 1.3}, V{0, 0, 1.3}, V{0, d, 0}},
                          {V{0, -d, 1.3}, V{0, 0, 1.3}, V{w, 0, 0}},
                          {V{0, d, 1.3}, V{w, 0, 0}, V{0, 0, 1.3}}};
  for (int i = 0; i < 8; ++i) {
    const double x = (1.4 * unit(rng) - 0.7) * w;
    const double y = (1.4 * unit(rng) - 0.7) * d;
    const double a = 0.15 + 0.3 * unit(rng);
    const double b = 0.15 + 0.3 * unit(rng);
    const double h = 0.15 + 0.5 * unit(rng);
    walls.push_back({V{x, y, 2 * h}, V{a, 0, 0}, V{0, b, 0}});
    walls.push_back({V{x - a, y, h}, V{0, 0, h}, V{0, b, 0}});
    walls.push_back({V{x, y - b, h}, V{a, 0, 0}, V{0, 0, h}});
  }
  return walls;
}

/// What an agent sees of walls that looks all round from T_world_maplet.
inline std::unique_ptr<Maplet> view(const std::vector<Wall>& walls, const Se3& T_world_maplet,
                                    std::uint16_t agent, std::uint32_t id) {
  auto m = std::make_unique<Maplet>();
  fill(*m, walls, T_world_maplet);
  m->key = {agent, 1, id};
  for (int i = 1; i < 8; ++i) {
    const Se3 turn = Se3::exp((Vector6d() << 0, 0, 0, 0, 0.785 * i, 0).finished());
    m->keyframes.push_back({Stamp{i}, Transform<MapletFrame, CameraFrame>{turn}});
  }
  return m;
}

}  // namespace maplet::test
