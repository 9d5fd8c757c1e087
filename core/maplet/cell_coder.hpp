// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "core/maplet/bit_coder.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet {

/// A cell is predicted from six that came before it: its neighbours left (2) and above (4). Learnt
/// over all planes of a layer.
class CellModels {
 public:
  void start_grid() noexcept {
    for (auto& row : rows_) row.fill(0);
  }
  void start_row() noexcept {
    std::swap(rows_[2], rows_[1]);
    std::swap(rows_[1], rows_[0]);
    left_ = 0;
  }
  [[nodiscard]] BitModel& at(int column) noexcept {
    const std::uint8_t* above = &rows_[1][static_cast<std::size_t>(column) + 1];
    const unsigned context = left_ | above[0] << 2 | above[-1] << 3 | above[1] << 4 |
                             rows_[2][static_cast<std::size_t>(column) + 1] << 5;
    return models_[context];
  }
  void set(int column, bool bit) noexcept {
    rows_[0][static_cast<std::size_t>(column) + 1] = bit ? 1 : 0;
    left_ = ((left_ << 1) | (bit ? 1U : 0U)) & 3U;
  }

 private:
  std::array<BitModel, 64> models_{};
  std::array<std::array<std::uint8_t, kMaxGridCells + 2>, 3> rows_{};  // this, above, above that
  unsigned left_ = 0;
};

/// Blocks of 2^shift cells a side, aligned to the plane's coordinates, not to the grid: what a
/// coarse layer says of a grid.
struct CoarseGrid {
  int shift, column0, row0, columns, rows;

  CoarseGrid(const CellGrid& grid, int by) noexcept
      : shift{by},
        column0{grid.column0 >> by},
        row0{grid.row0 >> by},
        columns{grid.columns == 0 ? 0 : ((grid.column0 + grid.columns - 1) >> by) - column0 + 1},
        rows{grid.rows == 0 ? 0 : ((grid.row0 + grid.rows - 1) >> by) - row0 + 1} {}

  /// Calls f(column, row) for the cells of `grid` inside a block.
  template <class F>
  void for_block(const CellGrid& grid, int block_column, int block_row, F f) const noexcept {
    const int left = ((column0 + block_column) << shift) - grid.column0;
    const int top = ((row0 + block_row) << shift) - grid.row0;
    const int right = std::min(left + (1 << shift), static_cast<int>(grid.columns));
    const int bottom = std::min(top + (1 << shift), static_cast<int>(grid.rows));
    for (int row = std::max(top, 0); row < bottom; ++row) {
      for (int column = std::max(left, 0); column < right; ++column) f(column, row);
    }
  }
};

/// Calls f(column, row, model) -> the cell, for all cells in coding order.
template <class F>
void for_cells(int columns, int rows, CellModels& models, F f) noexcept {
  models.start_grid();
  for (int row = 0; row < rows; ++row) {
    models.start_row();
    for (int column = 0; column < columns; ++column) {
      models.set(column, f(column, row, models.at(column)));
    }
  }
}

/// Writes cells of a layer, plane after plane.
class CellEncoder {
 public:
  explicit CellEncoder(ByteWriter& out) noexcept : bits_{out} {}

  /// All cells, in blocks of 2^shift a side: a block is set when one of its cells is.
  void put(const Maplet& m, const CellGrid& grid, int shift) noexcept {
    const CoarseGrid coarse{grid, shift};
    for_cells(coarse.columns, coarse.rows, models_[0], [&](int column, int row, BitModel& model) {
      const bool bit = any(m, grid, coarse, column, row);
      bits_.put(bit, model);
      return bit;
    });
  }
  /// The cells inside the blocks that put() with this shift said to be set.
  void refine(const Maplet& m, const CellGrid& grid, int shift) noexcept {
    const CoarseGrid coarse{grid, shift};
    for_cells(grid.columns, grid.rows, models_[1], [&](int column, int row, BitModel& model) {
      const int block_column = ((grid.column0 + column) >> shift) - coarse.column0;
      const int block_row = ((grid.row0 + row) >> shift) - coarse.row0;
      if (!any(m, grid, coarse, block_column, block_row)) return false;
      const bool bit = m.cell(grid, column, row);
      bits_.put(bit, model);
      return bit;
    });
  }
  void finish() noexcept { bits_.finish(); }

 private:
  static bool any(const Maplet& m, const CellGrid& grid, const CoarseGrid& coarse, int column,
                  int row) noexcept {
    if (coarse.shift == 0) return m.cell(grid, column, row);
    bool bit = false;
    coarse.for_block(grid, column, row, [&](int c, int r) { bit = bit || m.cell(grid, c, r); });
    return bit;
  }

  BitEncoder bits_;
  std::array<CellModels, 2> models_;
};

/// Reads what CellEncoder wrote.
class CellDecoder {
 public:
  explicit CellDecoder(ByteReader& in) noexcept : bits_{in} {}

  /// Sets whole blocks: the cells in them are exact after refine() only.
  void get(Maplet& m, const CellGrid& grid, int shift) noexcept {
    const CoarseGrid coarse{grid, shift};
    for_cells(coarse.columns, coarse.rows, models_[0], [&](int column, int row, BitModel& model) {
      const bool bit = bits_.get(model);
      if (bit) {
        coarse.for_block(grid, column, row, [&](int c, int r) { m.set_cell(grid, c, r); });
      }
      return bit;
    });
  }
  void refine(Maplet& m, const CellGrid& grid) noexcept {
    for_cells(grid.columns, grid.rows, models_[1], [&](int column, int row, BitModel& model) {
      if (!m.cell(grid, column, row)) return false;
      const bool bit = bits_.get(model);
      if (!bit) m.clear_cell(grid, column, row);
      return bit;
    });
  }

 private:
  BitDecoder bits_;
  std::array<CellModels, 2> models_;
};

}  // namespace maplet
