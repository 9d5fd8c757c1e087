// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/limits.hpp"
#include "core/patches/moments.hpp"
#include "core/patches/patch_config.hpp"
#include "core/patches/pyramid.hpp"

namespace maplet {

/// The second look: pixels of cells where planes end go to the adjacent plane that explains them
/// best, or to none.
///
/// Memory   fixed, from the arena: a byte a pixel, and a few a cell.
/// Time     O(pixels of border cells), vectorised; overruns its deadline by one row of cells.
/// Threads  one at a time.
/// Math     docs/math/patches.md, eq. 16
class Refiner {
 public:
  static constexpr std::uint8_t kNone = 0xFF;

  Refiner(const PatchConfig& config, Arena& arena);

  /// The plane of each cell, before pixels are looked at: index or kNone. Row by row,
  /// pyramid.cells_wide() in each.
  [[nodiscard]] std::span<std::uint8_t> cells() noexcept { return plane_of_cell_; }

  /// @param planes  fits of the planes that cells() names
  /// @param pixels  of each plane: what the second look found in border cells, less what the cells
  ///   themselves had, is added
  Stop run(const DepthFrame& frame, const Pyramid& pyramid, std::span<const Fit> planes,
           Deadline deadline) noexcept;
  /// No second look: the cells are the answer.
  void skip(const Pyramid& pyramid) noexcept;

  /// No frame: no labels.
  void forget() noexcept { wide_ = high_ = 0; }

  /// Plane of each pixel with a return plus 1; 0 = none.
  void write_labels(const DepthFrame& frame, std::span<std::uint16_t> out) const noexcept;
  [[nodiscard]] std::uint8_t plane_at(int u, int v) const noexcept;

 private:
  static constexpr int kMaxCandidates = 8;

  [[nodiscard]] int candidates(int i, int j, std::uint8_t* out) const noexcept;
  void look(int i, int j, const std::uint8_t* names, int count) noexcept;
  void lay_out(const Pyramid& pyramid) noexcept;

  PatchConfig config_;
  std::span<std::uint8_t> plane_of_cell_;
  std::span<std::uint8_t> from_pixels_;  ///< of a cell: 1 = see pixel_planes_
  std::span<std::uint8_t> reach_;        ///< of a cell without plane: the one its pixels found
  std::span<std::uint8_t> pixel_planes_;
  const DepthFrame* frame_ = nullptr;  ///< during run()
  std::span<const Fit> planes_;        ///< during run()
  DepthScale scale_;
  double sigma_steps_ = 1.0;
  int width_px_ = 0, height_px_ = 0;
  int cell_px_ = 8, wide_ = 0, high_ = 0;
};

}  // namespace maplet
