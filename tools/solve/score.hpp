// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "tools/solve/graph_file.hpp"

namespace maplet::graphs {

/// How far a solution is from the file's own truth: rms after the rigid motion that makes it least.
struct Accuracy {
  double ate_rms_m = 0.0;           ///< all agents' poses by one motion
  double odometry_ate_rms_m = 0.0;  ///< each agent's odometry alone, by its own motion
  double points_rms_m = 0.0;        ///< of the points, by the poses' motion
  std::size_t poses = 0;
  std::size_t points = 0;
};

/// @return nothing when the file has no truth, or fewer than three poses of it are solved
[[nodiscard]] std::optional<Accuracy> score(const GraphFile& file,
                                            const std::vector<Vertex>& solved);

}  // namespace maplet::graphs
