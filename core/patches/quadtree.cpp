// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/quadtree.hpp"

#include <algorithm>
#include <tuple>

namespace maplet {

namespace {

/// A pixel's explainable residual counts up to this many variances: a depth step of a metre is not
/// more worth splitting than one of ten sigmas.
constexpr double kGainCapVariances = 100.0;
/// A cell with fewer pixels holds no quarter worth having.
constexpr std::uint32_t kLeastSplitPx = 12;
/// Weight of the noise model against what the frame shows.
constexpr double kPriorDof = 60.0;
/// Looking at the clock costs as much as a node.
constexpr unsigned kNodesPerLook = 4;
/// Parameters of a plane.
constexpr double kPlaneDof = 3.0;
/// Unevenness a pixel, in variances, up to which a leaf tells of noise and not of its surface.
constexpr double kEvenVariances = 0.25;
/// Fewer tell too little of a pixel's noise.
constexpr double kLeastInsideDof = 2000.0;

}  // namespace

Quadtree::Quadtree(const PatchConfig& config, Arena& arena)
    : config_{config},
      leaves_{arena.make_array<Leaf>(kMaxLeaves, "patches/leaves")},
      leaf_of_cell_{arena.make_array<std::int16_t>(kMaxFrameCells * 4, "patches/leaf of quarter")},
      cells_{arena.make_array<Cell>(kMaxFrameCells, "patches/cells to split")},
      heap_{arena.make_array<OpenNode>(kMaxFrameCells * 4 / 3 + 1, "patches/open nodes")} {}

bool Quadtree::OpenNode::operator<(const OpenNode& o) const noexcept {
  return std::tie(gain, level, o.j, o.i) < std::tie(o.gain, o.level, j, i);
}

Stop Quadtree::run(Pyramid& pyramid, const CameraModel& camera, double correlated_px,
                   Deadline deadline) noexcept {
  pyramid_ = &pyramid;
  pixel_frame_ = PixelFrame{camera};
  correlated_px_ = correlated_px;
  leaf_count_ = patch_count_ = heap_size_ = cell_count_ = 0;
  explained_ = explained_dof_ = inside_ = inside_dof_ = 0.0;
  width_ = pyramid.width(0);
  height_ = pyramid.height(0);
  std::fill_n(leaf_of_cell_.begin(), width_ * height_, std::int16_t{-1});
  const auto limit = static_cast<std::size_t>(config_.max_patches);

  const int top = pyramid.levels() - 1;
  for (int j = 0; j < pyramid.height(top); ++j) {
    for (int i = 0; i < pyramid.width(top); ++i) {
      if (patch_count_ >= limit) return Stop::kIterationLimit;
      consider(top, i, j);
    }
  }
  for (unsigned nodes = 0; heap_size_ > 0; ++nodes) {
    if (nodes % kNodesPerLook == 0 && deadline.expired()) return Stop::kDeadline;
    std::pop_heap(heap_.begin(), heap_.begin() + static_cast<std::ptrdiff_t>(heap_size_));
    const OpenNode node = heap_[--heap_size_];
    for (int k = 0; k < 4; ++k) {
      if (patch_count_ >= limit) return Stop::kIterationLimit;
      consider(node.level - 1, 2 * node.i + k % 2, 2 * node.j + k / 2);
    }
  }
  return split_cells(deadline);
}

Stop Quadtree::split_cells(Deadline deadline) noexcept {
  for (std::size_t k = 0; k < cell_count_; ++k) {
    if (k % kNodesPerLook == 0 && deadline.expired()) return Stop::kDeadline;
    const Cell cell = cells_[k];
    if (leaf_count_ + 4 > kMaxLeaves || !pyramid_->split_cell(cell.i, cell.j)) break;
    for (int q = 0; q < 4; ++q) consider(0, 2 * cell.i + q % 2, 2 * cell.j + q / 2);
  }
  return Stop::kConverged;
}

void Quadtree::consider(int level, int i, int j) noexcept {
  float gain = 0.0F;
  Fit f;
  switch (judge(level, i, j, gain, f)) {
    case Verdict::kFlat:
      add_leaf(level, i, j, f);
      break;
    case Verdict::kSplit:
      if (level == Pyramid::kCellLevel) {
        cells_[cell_count_++] = {static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(j)};
        break;
      }
      heap_[heap_size_++] = {gain, static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(j),
                             static_cast<std::uint8_t>(level)};
      std::push_heap(heap_.begin(), heap_.begin() + static_cast<std::ptrdiff_t>(heap_size_));
      break;
    case Verdict::kDrop:
      break;
  }
}

Quadtree::Verdict Quadtree::judge(int level, int i, int j, float& gain, Fit& f) const noexcept {
  const PyramidNode& node = pyramid_->at(level, i, j);
  if (node.cells == 0) return Verdict::kDrop;
  const bool can_split =
      level > Pyramid::kCellLevel || (level == Pyramid::kCellLevel && node.pixels >= kLeastSplitPx);
  const Verdict otherwise = can_split ? Verdict::kSplit : Verdict::kDrop;
  const Moments& m = node.moments;
  f = level <= Pyramid::kCellLevel ? pyramid_->fit_of(level, i, j) : fit(m);
  const double variance = pyramid_->variance(f);
  // Eq. 8: what the cells' own planes explain of this node's residual, in variances.
  const double explained = std::max(0.0, f.rss - node.cells_rss) / variance;
  gain = static_cast<float>(std::min(explained, kGainCapVariances * m.n));
  if (!f.ok || node.pixels < config_.min_valid_fraction * pyramid_->area_px(level, i, j)) {
    return otherwise;
  }
  if (f.rss > pyramid_->flat_limit(f) * m.n) return otherwise;
  // Eq. 9: noise gives every cell's own plane three parameters' worth of residual.
  const double noise = correlated_px_ * kPlaneDof * (node.cells - 1);
  const double bias = config_.split_bias_sigmas * config_.split_bias_sigmas * m.n;
  if (level > Pyramid::kCellLevel && explained > 1.5 * noise + bias) return Verdict::kSplit;
  return seen_steeply(f) ? otherwise : Verdict::kFlat;
}

double Quadtree::correlated_px() const noexcept {
  return (kPriorDof * correlated_px_ + explained_) / (kPriorDof + explained_dof_);
}

double Quadtree::pixel_variance() const noexcept {
  const double model = pyramid_->variance(Fit{});
  return inside_dof_ < kLeastInsideDof ? model : std::clamp(inside_ / inside_dof_, 0.0, model);
}

bool Quadtree::seen_steeply(const Fit& f) const noexcept {
  // cos = n . m / |m| with n = theta / |theta| and theta . m = w (eq. 10); w <= 0 is no surface.
  const Eigen::Vector3d theta = pixel_frame_.theta(f);
  const Eigen::Vector2d ray = pixel_frame_.ray(f.u0, f.v0);
  const double w = f.w0 / kInverseDepthSteps;
  const double limit = config_.min_incidence_cos * config_.min_incidence_cos;
  return !(w > 0.0) || w * w < limit * theta.squaredNorm() * (ray.squaredNorm() + 1.0);
}

void Quadtree::add_leaf(int level, int i, int j, const Fit& f) noexcept {
  const auto index = static_cast<std::int16_t>(leaf_count_);
  patch_count_ += level >= Pyramid::kCellLevel ? 1 : 0;
  leaves_[leaf_count_++] = {static_cast<std::uint16_t>(i),
                            static_cast<std::uint16_t>(j),
                            static_cast<std::uint8_t>(level),
                            false,
                            Leaf::kNoRegion,
                            f.rss};
  const PyramidNode& node = pyramid_->at(level, i, j);
  if (level >= Pyramid::kCellLevel) {
    const double variance = pyramid_->variance(f);
    const double explained = std::max(0.0, f.rss - node.cells_rss) / variance;
    const double dof = kPlaneDof * (node.cells - 1);
    if (explained <= 1.5 * correlated_px_ * dof + kEvenVariances * node.moments.n) {
      explained_ += explained;
      explained_dof_ += dof;
    }
    inside_ += node.cells_rss - (variance - pyramid_->variance(Fit{})) * node.moments.n;
    inside_dof_ += node.moments.n - kPlaneDof * node.cells;
  }
  if (level == 0) {
    leaf_of_cell_[j * width_ + i] = index;
    return;
  }
  if (level == Pyramid::kCellLevel) {
    std::int16_t* upper = leaf_of_cell_.data() + 2 * j * width_ + 2 * i;
    upper[0] = upper[1] = upper[width_] = upper[width_ + 1] = index;
    return;
  }
  const int edge = 1 << level;
  for (int y = j * edge; y < (j + 1) * edge; ++y) {
    std::fill_n(leaf_of_cell_.begin() + y * width_ + i * edge, edge, index);
  }
}

}  // namespace maplet
