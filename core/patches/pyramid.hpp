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
  std::uint16_t reserved = 0;
};

/// Moments of all squares of the image: cells at level 0, each level twice as coarse.
///
/// Memory   fixed, from the arena: 4/3 kMaxFrameCells nodes.
/// Time     fill(): O(pixels), vectorised; overruns its deadline by one row of cells at most.
/// Threads  one at a time.
/// Math     docs/math/patches.md, eq. 1-2
class Pyramid {
 public:
  static constexpr int kMaxLevels = 7;

  Pyramid(const PatchConfig& config, Arena& arena);

  /// Reads the frame. Rows of cells come in an order that spreads over the image, so that a cut
  /// leaves no half of it unseen.
  /// @return false when the deadline passed before the last row
  bool fill(const DepthFrame& frame, Deadline deadline) noexcept;

  [[nodiscard]] int cell_px() const noexcept { return cell_px_; }
  [[nodiscard]] int levels() const noexcept { return levels_; }
  /// Size of a level in nodes. Level 0 without the padding.
  [[nodiscard]] int width(int level) const noexcept { return padded_width_ >> level; }
  [[nodiscard]] int height(int level) const noexcept { return padded_height_ >> level; }
  [[nodiscard]] int cells_wide() const noexcept { return cells_wide_; }
  [[nodiscard]] int cells_high() const noexcept { return cells_high_; }
  [[nodiscard]] const PyramidNode& at(int level, int i, int j) const noexcept {
    return nodes_[offset_[level] + j * width(level) + i];
  }
  /// Pixels of the image inside a node, with or without a return.
  [[nodiscard]] int area_px(int level, int i, int j) const noexcept;
  /// Standard deviation of w for pixels of weight 1; others are weighted to it.
  [[nodiscard]] double sigma_steps() const noexcept { return sigma_steps_; }
  [[nodiscard]] std::uint32_t valid_pixels() const noexcept { return valid_pixels_; }

 private:
  bool lay_out(const DepthFrame& frame) noexcept;
  void fill_row(const DepthFrame& frame, int j) noexcept;
  void weigh(Moments& moments) const noexcept;
  void build_levels() noexcept;
  PyramidNode& node(int level, int i, int j) noexcept {
    return nodes_[offset_[level] + j * width(level) + i];
  }

  PatchConfig config_;
  BlockRowFunction sum_blocks_;
  std::span<PyramidNode> nodes_;
  std::array<int, kMaxLevels> offset_{};
  DepthScale scale_;
  NoiseModel noise_;
  double sigma_steps_ = 1.0;
  int width_px_ = 0, height_px_ = 0;
  int cell_px_ = 8, levels_ = 1;
  int cells_wide_ = 0, cells_high_ = 0;
  int padded_width_ = 0, padded_height_ = 0;
  std::uint32_t valid_pixels_ = 0;
};

}  // namespace maplet
