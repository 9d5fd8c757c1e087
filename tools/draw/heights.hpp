// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tools/draw/contour.hpp"
#include "tools/files/surface.hpp"

namespace maplet::draw {

/// Calls visit(p) for points all over a strip, no further than `spacing_m` apart.
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

/// How high upright surfaces stand on each small square of the plan: what walls are drawn from.
///
/// A height seen by several maplets, or in several pieces, counts once; pieces that lie a square
/// apart count as one wall.
class HeightGrid {
 public:
  HeightGrid(const Bounds& bounds, double cell_m);

  /// A point of an upright surface, page frame.
  void add(const Eigen::Vector3d& p) noexcept;
  /// Where at least `high_m` of height was seen.
  [[nodiscard]] CoverGrid at_least(double high_m) const;
  [[nodiscard]] double cell_m() const noexcept { return frame_.cell_m(); }

  static constexpr double kSlice_m = 0.1;

 private:
  CoverGrid frame_;                    ///< empty: where the squares lie
  std::vector<std::uint64_t> slices_;  ///< a bit for each slice of height, round and round
};

}  // namespace maplet::draw
