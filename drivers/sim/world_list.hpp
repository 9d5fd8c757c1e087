// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "drivers/sim/world.hpp"

namespace maplet::sim {

[[nodiscard]] World make_room(const SimOptions& options);       ///< furnished, 6 x 5 x 2.7 m
[[nodiscard]] World make_loop(const SimOptions& options);       ///< corridors round a block
[[nodiscard]] World make_corridor(const SimOptions& options);   ///< no ends, no features
[[nodiscard]] World make_symmetric(const SimOptions& options);  ///< two views of it are alike
[[nodiscard]] World make_wall(const SimOptions& options);       ///< one plane
[[nodiscard]] World make_edge(const SimOptions& options);       ///< two planes

}  // namespace maplet::sim
