// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "tools/draw/contour.hpp"
#include "tools/files/surface.hpp"

namespace maplet::draw {

/// Calls visit(p) for points all over a strip, no further than `spacing_m` apart, each of them
/// standing for the same area.
template <class Visit>
void sample(const files::Strip& strip, double spacing_m, Visit&& visit) {
  const int along = std::max(1, static_cast<int>(std::ceil(strip.along.norm() / spacing_m)));
  const int across = std::max(1, static_cast<int>(std::ceil(strip.across.norm() / spacing_m)));
  for (int i = 0; i < along; ++i) {
    for (int j = 0; j < across; ++j) {
      visit(Eigen::Vector3d{strip.corner + (i + 0.5) / along * strip.along +
                            (j + 0.5) / across * strip.across});
    }
  }
}

/// A stretch of an upright surface, seen from above.
struct WallStretch {
  Eigen::Vector2d from, to;
  double high_m = 0.0;  ///< height that was seen of it, on average
};

/// An upright surface as stretches where it was seen; gaps of a few centimetres are closed.
/// @param surface  page frame (z up)
[[nodiscard]] std::vector<WallStretch> stretches_of(const files::Surface& surface);

}  // namespace maplet::draw
