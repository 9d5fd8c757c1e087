// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "tools/solve/graph_file.hpp"

namespace maplet::graphs {

/// An edge's place in time.
struct Item {
  std::int64_t moment;   ///< of the newest pose: microseconds, or its number within its agent
  std::uint64_t newest;  ///< that pose
  int edge;
};

/// An edge that is left out, and why.
struct BadEdge {
  int edge;
  const char* why;
};

struct Order {
  static constexpr std::size_t kMostNamed = 10;
  std::vector<Item> items;
  std::uint64_t bad_edges = 0;
  std::vector<BadEdge> named;  ///< the first of them
  std::size_t nodes = 0;
};

/// Edges in the order in which they come: a pose at a time, its odometry first, then sights.
[[nodiscard]] Order in_time_order(const GraphFile& graph);

/// Follows its agent's poses one by one, and is trusted; all else between poses is a closure.
[[nodiscard]] bool is_odometry(const Edge& e);

}  // namespace maplet::graphs
