// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/pyramid.hpp"

#include <algorithm>
#include <bit>

namespace maplet {

namespace {

constexpr int kMaxBlocksWide = static_cast<int>(kMaxWidthPx) / kBlockPx + 1;

/// Below this the rounding of 1/Z to steps is no longer small against the noise.
constexpr double kLeastSigmaSteps = 1.0;

constexpr int round_up(int value, int multiple) {
  return (value + multiple - 1) / multiple * multiple;
}

/// 0, 1/2, 1/4, 3/4, 1/8, ...: the order of rows under a deadline.
int bit_reversed(unsigned value, int bits) noexcept {
  unsigned out = 0;
  for (int b = 0; b < bits; ++b) out |= ((value >> b) & 1U) << (bits - 1 - b);
  return static_cast<int>(out);
}

}  // namespace

Pyramid::Pyramid(const PatchConfig& config, Arena& arena)
    : config_{config},
      sum_blocks_{block_variants().back().sum},
      nodes_{arena.make_array<PyramidNode>(kMaxFrameCells * 4 / 3 + 1, "patches/pyramid")} {}

bool Pyramid::lay_out(const DepthFrame& frame) noexcept {
  width_px_ = frame.depth.width_px;
  height_px_ = frame.depth.height_px;
  valid_pixels_ = 0;
  cells_wide_ = cells_high_ = padded_width_ = padded_height_ = 0;
  if (frame.depth.empty() || width_px_ <= 0 || height_px_ <= 0 ||
      width_px_ > static_cast<int>(kMaxWidthPx) || height_px_ > static_cast<int>(kMaxHeightPx)) {
    return false;
  }
  cell_px_ = static_cast<int>(std::bit_ceil(static_cast<unsigned>(std::max(config_.cell_px, 8))));
  for (;; cell_px_ *= 2) {
    const auto ratio = static_cast<unsigned>(std::max(1, config_.max_node_px / cell_px_));
    levels_ = std::clamp(static_cast<int>(std::bit_width(ratio)), 1, kMaxLevels);
    const int multiple = 1 << (levels_ - 1);
    cells_wide_ = (width_px_ + cell_px_ - 1) / cell_px_;
    cells_high_ = (height_px_ + cell_px_ - 1) / cell_px_;
    padded_width_ = round_up(cells_wide_, multiple);
    padded_height_ = round_up(cells_high_, multiple);
    if (padded_width_ * padded_height_ <= static_cast<int>(kMaxFrameCells)) break;
  }
  int offset = 0;
  for (int level = 0; level < levels_; ++level) {
    offset_[level] = offset;
    offset += width(level) * height(level);
  }
  std::fill_n(nodes_.begin(), width(0) * height(0), PyramidNode{});
  return true;
}

bool Pyramid::fill(const DepthFrame& frame, Deadline deadline) noexcept {
  if (!lay_out(frame)) return true;
  scale_ = DepthScale::of(frame.metres_per_unit);
  noise_ = frame.noise;
  // Any distance serves as reference where the noise depends on it: weights are relative.
  sigma_steps_ = std::max(noise_.sigma_inverse_depth(0.5) * kInverseDepthSteps, kLeastSigmaSteps);
  const auto bits = static_cast<int>(std::bit_width(static_cast<unsigned>(cells_high_ - 1)));
  bool complete = true;
  for (unsigned k = 0; k < (1U << bits); ++k) {
    const int j = bit_reversed(k, bits);
    if (j >= cells_high_) continue;
    if (deadline.expired()) {
      complete = false;
      break;
    }
    fill_row(frame, j);
  }
  build_levels();
  return complete;
}

void Pyramid::fill_row(const DepthFrame& frame, int j) noexcept {
  BlockSums sums[kMaxBlocksWide];
  const int full_blocks = width_px_ / kBlockPx;
  const int ragged = width_px_ % kBlockPx;
  const int blocks = full_blocks + (ragged != 0 ? 1 : 0);
  const int per_cell = cell_px_ / kBlockPx;
  const int end_v = std::min(height_px_, (j + 1) * cell_px_);
  for (int v = j * cell_px_; v < end_v; v += kBlockPx) {
    const int rows = std::min(kBlockPx, end_v - v);
    const std::uint16_t* pixels = frame.depth.row(v);
    sum_blocks_(pixels, frame.depth.stride_px, rows, full_blocks, scale_, sums);
    if (ragged != 0) {
      sum_block_plain(pixels + full_blocks * kBlockPx, frame.depth.stride_px, ragged, rows, scale_,
                      sums[full_blocks]);
    }
    for (int b = 0; b < blocks; ++b) {
      if (sums[b].n == 0) continue;
      PyramidNode& cell = node(0, b / per_cell, j);
      cell.moments += sums[b].moments(b * kBlockPx - width_px_ / 2, v - height_px_ / 2, 1);
      cell.pixels += static_cast<std::uint32_t>(sums[b].n);
    }
  }
  for (int i = 0; i < cells_wide_; ++i) {
    PyramidNode& cell = node(0, i, j);
    if (cell.pixels < 3) continue;
    if (noise_.kind == NoiseModel::Kind::kTimeOfFlight) weigh(cell.moments);
    const Fit f = fit(cell.moments);
    cell.cells_rss = f.rss;
    cell.cells = f.ok ? 1 : 0;
    valid_pixels_ += cell.pixels;
  }
}

/// One weight a cell: the noise changes little over its few pixels.
void Pyramid::weigh(Moments& moments) const noexcept {
  const double mean = std::max(moments.w / moments.n, 1.0) / kInverseDepthSteps;
  const double sigma =
      std::max(noise_.sigma_inverse_depth(mean) * kInverseDepthSteps, kLeastSigmaSteps);
  moments *= (sigma_steps_ / sigma) * (sigma_steps_ / sigma);
}

void Pyramid::build_levels() noexcept {
  for (int level = 1; level < levels_; ++level) {
    for (int j = 0; j < height(level); ++j) {
      for (int i = 0; i < width(level); ++i) {
        PyramidNode sum;
        for (int k = 0; k < 4; ++k) {
          const PyramidNode& child = at(level - 1, 2 * i + k % 2, 2 * j + k / 2);
          sum.moments += child.moments;
          sum.cells_rss += child.cells_rss;
          sum.pixels += child.pixels;
          sum.cells = static_cast<std::uint16_t>(sum.cells + child.cells);
        }
        node(level, i, j) = sum;
      }
    }
  }
}

int Pyramid::area_px(int level, int i, int j) const noexcept {
  const int edge = cell_px_ << level;
  return std::max(0, std::min(edge, width_px_ - i * edge)) *
         std::max(0, std::min(edge, height_px_ - j * edge));
}

}  // namespace maplet
