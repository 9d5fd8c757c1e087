// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/cell_map.hpp"

#include <algorithm>

#include "core/maplet/depth_look.hpp"

namespace maplet {

void Tile::vote(int cell, bool hit) noexcept {
  std::uint8_t& counter = hit ? hits[cell] : frees[cell];
  if (counter == 255) {
    hits[cell] /= 2;
    frees[cell] /= 2;
  }
  ++counter;
}

bool Tile::occupied(int cell, double max_free_share) const noexcept {
  return ((touched >> cell) & 1U) != 0 && is_surface(hits[cell], frees[cell], max_free_share);
}

CellMap::CellMap(Arena& arena)
    : tiles_{arena.make_array<Tile>(kTiles, "maplet/tiles")},
      slots_{arena.make_array<std::int32_t>(kSlots, "maplet/tile index")} {}

void CellMap::clear() noexcept {
  std::fill(slots_.begin(), slots_.end(), 0);
  used_ = 0;
}

std::size_t CellMap::slot(std::uint32_t plane, int tile_column, int tile_row) const noexcept {
  std::uint32_t hash = plane * 0x9E3779B1U;
  hash = (hash ^ static_cast<std::uint16_t>(tile_column)) * 0x85EBCA6BU;
  hash = (hash ^ static_cast<std::uint16_t>(tile_row)) * 0xC2B2AE35U;
  std::size_t at = (hash ^ (hash >> 15)) % kSlots;
  for (; slots_[at] != 0; at = (at + 1) % kSlots) {
    const Tile& t = tiles_[slots_[at] - 1];
    if (t.plane == plane && t.column == tile_column && t.row == tile_row) break;
  }
  return at;
}

Tile* CellMap::find(std::uint32_t plane, int column, int row) const noexcept {
  // Shifts of negative numbers round down: what floor division needs.
  const std::int32_t index = slots_[slot(plane, column >> 3, row >> 3)];
  return index == 0 ? nullptr : &tiles_[index - 1];
}

Tile* CellMap::make(std::uint32_t plane, std::int32_t& first, int column, int row) noexcept {
  const std::size_t at = slot(plane, column >> 3, row >> 3);
  if (slots_[at] != 0) return &tiles_[slots_[at] - 1];
  if (used_ == kTiles) return nullptr;
  Tile& t = tiles_[used_];
  t = {};
  t.plane = plane;
  t.column = static_cast<std::int16_t>(column >> 3);
  t.row = static_cast<std::int16_t>(row >> 3);
  t.next = first;
  first = static_cast<std::int32_t>(used_);
  slots_[at] = static_cast<std::int32_t>(++used_);
  return &t;
}

}  // namespace maplet
