// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/pyramid.hpp"

#include <algorithm>
#include <bit>

namespace maplet {

namespace {

int finest_px(const PatchConfig& config) noexcept {
  return static_cast<int>(std::bit_ceil(static_cast<unsigned>(std::max(config.cell_px, kBlockPx))));
}

/// Most cells of an image at one edge, its padding to whole largest nodes included.
std::size_t padded_cells(const PatchConfig& config, const ImageSize& image, int cell_px) noexcept {
  const int margin = std::max(1, config.max_node_px / cell_px);
  return static_cast<std::size_t>(image.width_px / cell_px + margin) *
         static_cast<std::size_t>(image.height_px / cell_px + margin);
}

std::size_t cells_of(const PatchConfig& config, const ImageSize& image) noexcept {
  return std::min(padded_cells(config, image, finest_px(config)), kMaxFrameCells);
}

/// Cells that may be split in one frame: half of them.
std::size_t split_cells_of(const PatchConfig& config, const ImageSize& image) noexcept {
  return std::min(cells_of(config, image) / 2, Pyramid::kMaxSplitCells);
}

std::size_t blocks_of(const ImageSize& image) noexcept {
  const ImageSize blocks = image.decimated(kBlockPx);
  return blocks.pixels();
}

/// Below this the rounding of 1/Z to steps is no longer small against the noise.
constexpr double kLeastSigmaSteps = 1.0;
/// 30 1/m: no sensor; keeps squares finite.
constexpr double kMostSigmaSteps = 1e6;

/// Of any noise model, whatever its figures.
double sigma_in_steps(const NoiseModel& noise, double inverse_depth) noexcept {
  const double steps = noise.sigma_inverse_depth(inverse_depth) * kInverseDepthSteps;
  return steps >= kLeastSigmaSteps ? std::min(steps, kMostSigmaSteps) : kLeastSigmaSteps;
}

/// Of any noise model: no camera's pixels wander farther.
double lateral_px(const NoiseModel& noise) noexcept {
  constexpr double kMostPx = 4.0;
  return noise.lateral_px > 0.0 ? std::min(noise.lateral_px, kMostPx) : 0.0;
}

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

Pyramid::Pyramid(const PatchConfig& config, const ImageSize& largest, Arena& arena)
    : config_{config},
      largest_{largest},
      sum_blocks_{block_variants().back().sum},
      nodes_{
          arena.make_array<PyramidNode>(cells_of(config, largest) * 4 / 3 + 1, "patches/pyramid")},
      blocks_{arena.make_array<BlockSums>(blocks_of(largest), "patches/blocks")},
      cell_fits_{arena.make_array<Fit>(cells_of(config, largest), "patches/planes of cells")},
      split_limit_{split_cells_of(config, largest)},
      quarters_{arena.make_array<PyramidNode>(split_limit_ * 4, "patches/quarters")},
      quarter_fits_{arena.make_array<Fit>(split_limit_ * 4, "patches/planes of quarters")},
      split_{arena.make_array<std::int16_t>(cells_of(config, largest), "patches/split cells")} {}

bool Pyramid::try_cells(int cell_px) noexcept {
  cell_px_ = cell_px;
  const auto ratio = static_cast<unsigned>(std::max(1, config_.max_node_px / cell_px_));
  levels_ = std::clamp(static_cast<int>(std::bit_width(ratio)) + 1, 2, kMaxLevels);
  const int multiple = 1 << (levels_ - 1 - kCellLevel);
  cells_wide_ = (width_px_ + cell_px_ - 1) / cell_px_;
  cells_high_ = (height_px_ + cell_px_ - 1) / cell_px_;
  padded_width_ = round_up(cells_wide_, multiple);
  padded_height_ = round_up(cells_high_, multiple);
  return padded_width_ * padded_height_ <= static_cast<int>(kMaxFrameCells);
}

Pyramid::Grain Pyramid::finest(int width_px, int height_px) const noexcept {
  Grain grain{finest_px(config_), 1};
  while (padded_cells(config_, {width_px, height_px}, grain.cell_px) > kMaxFrameCells) {
    grain.cell_px *= 2;
  }
  return grain;
}

bool Pyramid::lay_out(const DepthFrame& frame) noexcept {
  width_px_ = frame.depth.width_px;
  height_px_ = frame.depth.height_px;
  valid_pixels_ = 0;
  split_count_ = 0;
  cells_wide_ = cells_high_ = padded_width_ = padded_height_ = 0;
  if (frame.depth.empty() || width_px_ <= 0 || height_px_ <= 0 ||
      !largest_.holds(width_px_, height_px_)) {
    return false;
  }
  while (!try_cells(cell_px_)) cell_px_ *= 2;
  blocks_wide_ = (width_px_ + kBlockPx - 1) / kBlockPx;
  int offset = 0;
  for (int level = kCellLevel; level < levels_; ++level) {
    offset_[level] = offset;
    offset += width(level) * height(level);
  }
  std::fill_n(nodes_.begin(), padded_width_ * padded_height_, PyramidNode{});
  return true;
}

bool Pyramid::fill(const DepthFrame& frame, Grain grain, Deadline deadline) noexcept {
  cell_px_ = grain.cell_px;
  row_step_ = grain.row_step;
  if (!lay_out(frame)) return true;
  scale_ = DepthScale::of(frame.metres_per_unit);
  noise_ = frame.noise;
  // Any distance serves as reference where the noise depends on it: weights are relative.
  sigma_steps_ = sigma_in_steps(noise_, 0.5);
  lateral_px2_ = lateral_px(noise_) * lateral_px(noise_);
  flat_limit_ = config_.max_rms_sigmas * config_.max_rms_sigmas * sigma_steps_ * sigma_steps_;
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
  const int full_blocks = width_px_ / kBlockPx;
  const int ragged = width_px_ % kBlockPx;
  const int per_cell = cell_px_ / kBlockPx;
  const int block_high = kBlockPx * row_step_;
  const int end_v = std::min(height_px_, (j + 1) * cell_px_);
  for (int v = j * cell_px_; v < end_v; v += block_high) {
    const int rows = std::min(kBlockPx, (end_v - v + row_step_ - 1) / row_step_);
    const std::uint16_t* pixels = frame.depth.row(v);
    const std::ptrdiff_t stride = frame.depth.stride_px * row_step_;
    BlockSums* sums = blocks_.data() + v / block_high * blocks_wide_;
    sum_blocks_(pixels, stride, rows, full_blocks, scale_, sums);
    if (ragged != 0) {
      sum_block_plain(pixels + full_blocks * kBlockPx, stride, ragged, rows, scale_,
                      sums[full_blocks]);
    }
    for (int b = 0; b < blocks_wide_; ++b) {
      if (sums[b].valid == 0) continue;
      PyramidNode& cell = node(kCellLevel, b / per_cell, j);
      const Moments m =
          sums[b].moments(b * kBlockPx - width_px_ / 2, v - height_px_ / 2, row_step_);
      cell.moments += m;
      cell.pixels += static_cast<std::uint32_t>(m.n) * static_cast<std::uint32_t>(row_step_);
    }
  }
  const BlockSums* alone =
      per_cell == 1 && row_step_ == 1 ? blocks_.data() + j * blocks_wide_ : nullptr;
  for (int i = 0; i < cells_wide_; ++i) {
    PyramidNode& cell = node(kCellLevel, i, j);
    Fit& f = cell_fits_[j * padded_width_ + i];
    valid_pixels_ += cell.pixels;
    if (alone != nullptr && alone[i].valid == BlockSums::kAll && !weighted()) {
      f = alone[i].full_fit(i * kBlockPx - width_px_ / 2, j * kBlockPx - height_px_ / 2);
      cell.cells_rss = f.rss;
      cell.cells = 1;
    } else {
      fit_cell(cell, f);
    }
  }
}

void Pyramid::fit_cell(PyramidNode& cell, Fit& f) const noexcept {
  if (cell.pixels < 3) return;
  weigh(cell.moments);
  f = fit(cell.moments);
  cell.cells_rss = f.rss;
  cell.cells = f.ok ? 1 : 0;
}

bool Pyramid::split_cell(int i, int j) noexcept {
  if (split_count_ == split_limit_) return false;
  split_[j * padded_width_ + i] = static_cast<std::int16_t>(split_count_);
  PyramidNode* quarters = quarters_.data() + split_count_ * 4;
  Fit* fits = quarter_fits_.data() + split_count_ * 4;
  ++split_count_;
  std::fill_n(quarters, 4, PyramidNode{});
  if (cell_px_ == kBlockPx && row_step_ == 1 && !weighted()) {
    split_block(blocks_[j * blocks_wide_ + i], i * kBlockPx - width_px_ / 2,
                j * kBlockPx - height_px_ / 2, quarters, fits);
    return true;
  }
  split_blocks(i, j, quarters);
  for (int k = 0; k < 4; ++k) fit_cell(quarters[k], fits[k]);
  return true;
}

void Pyramid::split_block(const BlockSums& sums, int u0, int v0, PyramidNode* quarters,
                          Fit* fits) const noexcept {
  constexpr int kArea = kBlockPx * kBlockPx / 4;
  for (int q = 0; q < 4; ++q) {
    const std::uint64_t mask = BlockSums::mask(q);
    const std::uint64_t valid = sums.valid & mask;
    PyramidNode& quarter = quarters[q];
    if (valid == mask) {
      fits[q] = sums.full_quarter_fit(q, u0, v0);
      if (fits[q].rss > flat_limit(fits[q]) * kArea) continue;  // left without pixels
      quarter = {sums.quarter_moments(q, u0, v0, 1), fits[q].rss, kArea, 1};
      continue;
    }
    const int pixels = std::popcount(valid);
    if (pixels < config_.min_valid_fraction * kArea) continue;
    quarter.moments = sums.quarter_moments(q, u0, v0, 1);
    quarter.pixels = static_cast<std::uint32_t>(pixels);
    fit_cell(quarter, fits[q]);
  }
}

void Pyramid::split_blocks(int i, int j, PyramidNode* quarters) const noexcept {
  const int half = cell_px_ / 2;
  const int block_high = kBlockPx * row_step_;
  const int end_u = std::min(width_px_, (i + 1) * cell_px_);
  const int end_v = std::min(height_px_, (j + 1) * cell_px_);
  const auto add = [&](PyramidNode& quarter, const Moments& m) {
    quarter.moments += m;
    quarter.pixels += static_cast<std::uint32_t>(m.n) * static_cast<std::uint32_t>(row_step_);
  };
  for (int v = j * cell_px_; v < end_v; v += block_high) {
    for (int u = i * cell_px_; u < end_u; u += kBlockPx) {
      const BlockSums& sums = blocks_[v / block_high * blocks_wide_ + u / kBlockPx];
      if (sums.valid == 0) continue;
      const int right = (u - i * cell_px_) / half;
      const int below = (v - j * cell_px_) / half;
      const int u0 = u - width_px_ / 2;
      const int v0 = v - height_px_ / 2;
      if (half >= block_high) {  // a block lies in one quarter
        add(quarters[2 * below + right], sums.moments(u0, v0, row_step_));
        continue;
      }
      for (int q = 0; q < 4; ++q) {
        if ((sums.valid & BlockSums::mask(q)) == 0) continue;
        const int side = half >= kBlockPx ? right : q % 2;
        add(quarters[q / 2 * 2 + side], sums.quarter_moments(q, u0, v0, row_step_));
      }
    }
  }
}

/// One weight a cell: the noise changes little over its few pixels.
void Pyramid::weigh(Moments& moments) const noexcept {
  if (!weighted()) return;
  const double mean = std::max(moments.w / moments.n, 1.0) / kInverseDepthSteps;
  const double sigma = sigma_in_steps(noise_, mean);
  moments *= (sigma_steps_ / sigma) * (sigma_steps_ / sigma);
}

void Pyramid::build_levels() noexcept {
  for (int level = kCellLevel + 1; level < levels_; ++level) {
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

}  // namespace maplet
