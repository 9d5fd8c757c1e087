// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <utility>

namespace maplet::graphs {

/// Blocks of the Cholesky factor of a graph with these edges, ordered by approximate minimum
/// degree: what the solver's pool is sized by when all of the graph is known beforehand.
[[nodiscard]] int factor_blocks(int nodes, std::span<const std::pair<int, int>> edges);

}  // namespace maplet::graphs
