// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/heights.hpp"

#include <bit>

namespace maplet::draw {

HeightGrid::HeightGrid(const Bounds& bounds, double cell_m)
    : frame_{bounds, cell_m}, slices_(frame_.cells(), 0) {}

void HeightGrid::add(const Eigen::Vector3d& p) noexcept {
  const auto cell = frame_.cell_of(p.head<2>());
  if (!cell) return;
  const auto slice = static_cast<std::int64_t>(std::floor(p.z() / kSlice_m));
  slices_[*cell] |= std::uint64_t{1} << (static_cast<std::uint64_t>(slice) % 64);
}

CoverGrid HeightGrid::at_least(double high_m) const {
  const int wanted = static_cast<int>(std::lround(high_m / kSlice_m));
  const auto columns = static_cast<std::size_t>(frame_.columns());
  CoverGrid out = frame_;
  // The border of the grid is empty: neighbours are always there.
  for (std::size_t cell = columns + 1; cell + columns + 1 < slices_.size(); ++cell) {
    std::uint64_t seen = 0;
    for (const std::size_t row : {cell - columns, cell, cell + columns}) {
      seen |= slices_[row - 1] | slices_[row] | slices_[row + 1];
    }
    if (std::popcount(seen) >= wanted) out.cover_cell(cell);
  }
  return out;
}

}  // namespace maplet::draw
