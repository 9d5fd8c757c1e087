// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <utility>

#include "core/skeleton/pose_graph.hpp"
#include "tools/solve/order.hpp"

namespace maplet::graphs {

/// Blocks of the Cholesky factor of a graph with these edges, ordered by approximate minimum
/// degree: what the solver's pool is sized by when all of the graph is known beforehand.
[[nodiscard]] int factor_blocks(int nodes, std::span<const std::pair<int, int>> edges);

/// A graph that is kept small has at least so many nodes.
inline constexpr int kLeastNodes = 16;

/// What the engine needs for a file: room for all of it, the old factor and the new one with some
/// fill to spare; or, with max_nodes > 0, for that many and their share of the factors.
/// @param in_time  updates have a budget of time: a factor is made anew over several of them
[[nodiscard]] PoseGraphLimits limits_for(const GraphFile& file, std::span<const Item> items,
                                         std::size_t nodes, int max_nodes, bool in_time);

}  // namespace maplet::graphs
