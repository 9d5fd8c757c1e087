// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/patches/block.hpp"
#include "core/patches/moments.hpp"
#include "core/patches/patch_config.hpp"

namespace maplet {

/// What the pyramid knows of a square of the image.
struct PyramidNode {
  Moments moments;
  double cells_rss = 0.0;    ///< sum of its finest cells' residuals, steps^2
  std::uint32_t pixels = 0;  ///< with a return
  std::uint16_t cells = 0;   ///< finest cells with a fit
};

/// Moments of all squares of the image: cells at level 1, each level above twice as coarse. The
/// quarters of a cell, level 0, are made only where somebody asks for them: at edges.
///
/// Memory   fixed, from the arena: the sums of each 8 x 8 block, 4/3 kMaxFrameCells nodes, 4
///          kMaxSplitCells quarters.
/// Time     fill(): O(pixels), vectorised; overruns its deadline by one row of cells at most.
/// Threads  one at a time.
/// Math     docs/math/patches.md, eq. 1-2
class Pyramid {
 public:
  /// How finely the image is read. Coarser is faster: what a short budget pays for.
  struct Grain {
    int cell_px = 8;   ///< edge of a cell, a power of two from 8
    int row_step = 1;  ///< every n-th row of a cell
  };

  static constexpr int kMaxLevels = 8;
  static constexpr int kCellLevel = 1;
  static constexpr std::size_t kMaxSplitCells = 2048;

  Pyramid(const PatchConfig& config, Arena& arena);

  /// Reads the frame. Rows of cells come in an order that spreads over the image, so that a cut
  /// leaves no half of it unseen.
  /// @return false when the deadline passed before the last row
  bool fill(const DepthFrame& frame, Grain grain, Deadline deadline) noexcept;
  /// The finest grain that the configuration asks for and the arrays hold, for an image size.
  [[nodiscard]] Grain finest(int width_px, int height_px) const noexcept;

  /// Makes the quarters of a cell, from sums that fill() has kept; those that are not flat may be
  /// left without pixels.
  /// @return false when kMaxSplitCells have been split already
  bool split_cell(int i, int j) noexcept;

  [[nodiscard]] int cell_px() const noexcept { return cell_px_; }
  /// Edge of a node.
  [[nodiscard]] int edge_px(int level) const noexcept { return (cell_px_ << level) / 2; }
  [[nodiscard]] int levels() const noexcept { return levels_; }
  /// Size of a level in nodes, with padding up to whole nodes of the coarsest level.
  [[nodiscard]] int width(int level) const noexcept { return 2 * padded_width_ >> level; }
  [[nodiscard]] int height(int level) const noexcept { return 2 * padded_height_ >> level; }
  /// Cells that have pixels, without padding.
  [[nodiscard]] int cells_wide() const noexcept { return cells_wide_; }
  [[nodiscard]] int cells_high() const noexcept { return cells_high_; }
  /// Of level 0 only what split_cell() made.
  [[nodiscard]] const PyramidNode& at(int level, int i, int j) const noexcept {
    if (level == 0) {
      return quarters_[split_[j / 2 * padded_width_ + i / 2] * 4 + j % 2 * 2 + i % 2];
    }
    return nodes_[offset_[level] + j * width(level) + i];
  }
  /// Pixels of the image inside a node, with or without a return.
  [[nodiscard]] int area_px(int level, int i, int j) const noexcept;
  /// Pixels count by their distance.
  [[nodiscard]] bool weighted() const noexcept {
    return noise_.kind == NoiseModel::Kind::kTimeOfFlight;
  }
  /// Gives the pixels of one cell the weight of their distance (time of flight; else 1).
  void weigh(Moments& moments) const noexcept;
  /// Standard deviation of w for pixels of weight 1; others are weighted to it.
  [[nodiscard]] double sigma_steps() const noexcept { return sigma_steps_; }
  [[nodiscard]] std::uint32_t valid_pixels() const noexcept { return valid_pixels_; }

 private:
  bool lay_out(const DepthFrame& frame) noexcept;
  /// @return false when the arrays are too small
  bool try_cells(int cell_px) noexcept;
  void fill_row(const DepthFrame& frame, int j) noexcept;
  void fit_cell(PyramidNode& node) const noexcept;
  /// A quarter of a cell that is one block cannot be flat.
  [[nodiscard]] bool hopeless(const BlockSums& sums, int quarter,
                              std::uint64_t valid) const noexcept;
  void build_levels() noexcept;
  PyramidNode& node(int level, int i, int j) noexcept {
    return nodes_[offset_[level] + j * width(level) + i];
  }

  PatchConfig config_;
  BlockRowFunction sum_blocks_;
  std::span<PyramidNode> nodes_;
  std::span<BlockSums> blocks_;  ///< row by row, blocks_wide_ in each
  std::span<PyramidNode> quarters_;
  std::span<std::int16_t> split_;  ///< of a cell: index of its quarters / 4
  std::size_t split_count_ = 0;
  std::array<int, kMaxLevels> offset_{};
  DepthScale scale_;
  NoiseModel noise_;
  double sigma_steps_ = 1.0;
  int width_px_ = 0, height_px_ = 0;
  int cell_px_ = 8, row_step_ = 1, levels_ = 1;
  int cells_wide_ = 0, cells_high_ = 0, blocks_wide_ = 0;
  int padded_width_ = 0, padded_height_ = 0;
  std::uint32_t valid_pixels_ = 0;
};

}  // namespace maplet
