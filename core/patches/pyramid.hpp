// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/frame/image_size.hpp"
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
/// Memory   fixed, from the arena: for the largest image, the sums of each 8 x 8 block, 4/3
///          nodes a cell, the quarters of half of the cells, a plane for each cell and quarter.
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

  Pyramid(const PatchConfig& config, const ImageSize& largest, Arena& arena);

  /// Reads the frame. Rows of cells come in an order that spreads over the image, so that a cut
  /// leaves no half of it unseen.
  /// @return false when the deadline passed before the last row
  bool fill(const DepthFrame& frame, Grain grain, Deadline deadline) noexcept;
  /// The finest grain that the configuration asks for and the arrays hold, for an image size.
  [[nodiscard]] Grain finest(int width_px, int height_px) const noexcept;

  /// The plane of a cell or quarter that has pixels.
  [[nodiscard]] const Fit& fit_of(int level, int i, int j) const noexcept {
    return level == 0 ? quarter_fits_[quarter_at(i, j)] : cell_fits_[j * padded_width_ + i];
  }
  /// Makes the quarters of a cell, from sums that fill() has kept; those that are not flat may be
  /// left without pixels.
  /// @return false when half of the cells, or kMaxSplitCells, have been split already
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
    if (level == 0) return quarters_[quarter_at(i, j)];
    return nodes_[offset_[level] + j * width(level) + i];
  }
  /// Pixels of the image inside a node, with or without a return.
  [[nodiscard]] int area_px(int level, int i, int j) const noexcept {
    const int edge = edge_px(level);
    const int right = width_px_ - i * edge, below = height_px_ - j * edge;
    if (right >= edge && below >= edge) return edge * edge;
    return std::max(0, std::min(edge, right)) * std::max(0, std::min(edge, below));
  }
  /// Pixels count by their distance.
  [[nodiscard]] bool weighted() const noexcept {
    return noise_.kind == NoiseModel::Kind::kTimeOfFlight;
  }
  /// Gives the pixels of one cell the weight of their distance (time of flight; else 1).
  void weigh(Moments& moments) const noexcept;
  /// Standard deviation of w for pixels of weight 1; others are weighted to it.
  [[nodiscard]] double sigma_steps() const noexcept { return sigma_steps_; }
  /// Variance of w on a surface, steps^2: where it is slanted the sensor's lateral noise is noise
  /// of depth. Math: eq. 6.
  [[nodiscard]] double variance(const Fit& f) const noexcept {
    return sigma_steps_ * sigma_steps_ + lateral_px2_ * (f.a * f.a + f.b * f.b);
  }
  /// Mean squared residual at which a surface is not flat any more, steps^2. Math: eq. 7.
  [[nodiscard]] double flat_limit(const Fit& f) const noexcept {
    return flat_limit_ + kLateralLimit * lateral_px2_ * (f.a * f.a + f.b * f.b);
  }
  [[nodiscard]] std::uint32_t valid_pixels() const noexcept { return valid_pixels_; }

 private:
  /// Depth steps look like steep surfaces with lateral noise: these get less room.
  static constexpr double kLateralLimit = 1.5;

  bool lay_out(const DepthFrame& frame) noexcept;
  /// @return false when the arrays are too small
  bool try_cells(int cell_px) noexcept;
  void fill_row(const DepthFrame& frame, int j) noexcept;
  void fit_cell(PyramidNode& node, Fit& f) const noexcept;
  /// The quarters of a cell that is one block.
  void split_block(const BlockSums& sums, int u0, int v0, PyramidNode* quarters,
                   Fit* fits) const noexcept;
  void split_blocks(int i, int j, PyramidNode* quarters) const noexcept;
  [[nodiscard]] int quarter_at(int i, int j) const noexcept {
    return split_[j / 2 * padded_width_ + i / 2] * 4 + j % 2 * 2 + i % 2;
  }
  void build_levels() noexcept;
  PyramidNode& node(int level, int i, int j) noexcept {
    return nodes_[offset_[level] + j * width(level) + i];
  }

  PatchConfig config_;
  ImageSize largest_;
  BlockRowFunction sum_blocks_;
  std::span<PyramidNode> nodes_;
  std::span<BlockSums> blocks_;  ///< row by row, blocks_wide_ in each
  std::span<Fit> cell_fits_;
  std::size_t split_limit_;
  std::span<PyramidNode> quarters_;
  std::span<Fit> quarter_fits_;
  std::span<std::int16_t> split_;  ///< of a cell: index of its quarters / 4
  std::size_t split_count_ = 0;
  std::array<int, kMaxLevels> offset_{};
  DepthScale scale_;
  NoiseModel noise_;
  double sigma_steps_ = 1.0;
  double lateral_px2_ = 0.0, flat_limit_ = 1.0;
  int width_px_ = 0, height_px_ = 0;
  int cell_px_ = 8, row_step_ = 1, levels_ = 1;
  int cells_wide_ = 0, cells_high_ = 0, blocks_wide_ = 0;
  int padded_width_ = 0, padded_height_ = 0;
  std::uint32_t valid_pixels_ = 0;
};

}  // namespace maplet
