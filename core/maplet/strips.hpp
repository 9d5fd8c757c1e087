// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/maplet/maplet.hpp"

namespace maplet {

/// Calls visit(column, row, cells) for each run of occupied cells that touch in a row of a plane's
/// grid, row by row; column and row counted from the grid's own first ones.
template <class Visit>
void for_each_strip(const Maplet& maplet, const MapletPlane& plane, Visit&& visit) {
  const CellGrid& grid = plane.grid;
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const int first = column;
      while (column < grid.columns && maplet.cell(grid, column, row)) ++column;
      if (column > first) visit(first, row, column - first);
    }
  }
}

}  // namespace maplet
