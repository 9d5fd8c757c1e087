// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"

namespace maplet {

/// 8 x 8 cells of one plane, with what keyframes saw there.
struct Tile {
  static constexpr int kSide = 8;

  std::uint32_t plane;  ///< serial number
  std::int16_t column;  ///< its cells are [column * 8, +8)
  std::int16_t row;
  std::int32_t next;      ///< of the same plane, or -1
  std::uint64_t touched;  ///< cells that a patch covered
  std::array<std::uint8_t, kSide * kSide> hits;
  std::array<std::uint8_t, kSide * kSide> frees;  ///< looks through the cell

  /// Counts a look at a cell; old looks fade when a counter is full.
  void vote(int cell, bool hit) noexcept;
  [[nodiscard]] bool occupied(int cell, double max_free_share) const noexcept;
};

/// The extents of the planes of the maplet under construction: sparse, any size, fixed memory.
///
/// Memory   kTiles tiles and a hash table in the arena.
/// Time     O(1) for a tile. Threads  one.
class CellMap {
 public:
  static constexpr std::size_t kTiles = 4096;

  explicit CellMap(Arena& arena);
  void clear() noexcept;
  /// The tile of a cell (column, row), or nullptr.
  [[nodiscard]] Tile* find(std::uint32_t plane, int column, int row) const noexcept;
  /// The same, made when needed; nullptr when no tiles are left.
  /// @param first  head of the plane's list of tiles (-1 = none), extended
  [[nodiscard]] Tile* make(std::uint32_t plane, std::int32_t& first, int column, int row) noexcept;
  [[nodiscard]] Tile& tile(std::int32_t index) noexcept { return tiles_[index]; }
  [[nodiscard]] const Tile& tile(std::int32_t index) const noexcept { return tiles_[index]; }
  [[nodiscard]] std::size_t used() const noexcept { return used_; }
  [[nodiscard]] static int index_in_tile(int column, int row) noexcept {
    return (row & (Tile::kSide - 1)) * Tile::kSide + (column & (Tile::kSide - 1));
  }

 private:
  static constexpr std::size_t kSlots = 4 * kTiles;
  [[nodiscard]] std::size_t slot(std::uint32_t plane, int tile_column, int tile_row) const noexcept;

  std::span<Tile> tiles_;
  std::span<std::int32_t> slots_;  ///< tile index + 1; 0 = empty
  std::size_t used_ = 0;
};

}  // namespace maplet
