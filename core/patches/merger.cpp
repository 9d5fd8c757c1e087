// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/merger.hpp"

#include <algorithm>

namespace maplet {

namespace {

constexpr std::size_t kWordsPerRow = Merger::kMaxRegions / 64;
constexpr int kJoinPasses = 4;

}  // namespace

Merger::Merger(const PatchConfig& config, Arena& arena)
    : config_{config},
      regions_{arena.make_array<Region>(kMaxRegions, "patches/regions")},
      queue_{arena.make_array<std::uint16_t>(kMaxPatches, "patches/growing")},
      tested_pairs_{
          arena.make_array<std::uint64_t>(kMaxRegions * kWordsPerRow, "patches/tested pairs")} {}

Stop Merger::run(const Pyramid& pyramid, Quadtree& tree, double correlated_px,
                 Deadline deadline) noexcept {
  pyramid_ = &pyramid;
  tree_ = &tree;
  correlated_px_ = correlated_px;
  variance_ = pyramid.sigma_steps() * pyramid.sigma_steps();
  region_count_ = 0;
  bool complete = true;
  for (int level = pyramid.levels() - 1; level >= 0 && complete; --level) {
    for (std::size_t k = 0; k < tree.leaves().size() && complete; ++k) {
      const Leaf& leaf = tree.leaves()[k];
      if (leaf.level != level || leaf.region != Leaf::kNoRegion || leaf.seeded) continue;
      if (region_count_ == kMaxRegions) return Stop::kIterationLimit;
      complete = grow(k, deadline);
    }
  }
  if (complete) join_neighbours(deadline);
  return complete && !deadline.expired() ? Stop::kConverged : Stop::kDeadline;
}

bool Merger::same_plane(const Moments& a, double rss_a, const Moments& b, double rss_b,
                        double& rss_union) const noexcept {
  const Fit f = fit(a + b);
  rss_union = f.rss;
  const double more = (f.rss - rss_a - rss_b) / variance_;  // eq. 11
  const double pixels = a.n * b.n / (a.n + b.n);
  const double bias = config_.merge_bias_sigmas * config_.merge_bias_sigmas * pixels;
  return more <= correlated_px_ * config_.merge_chi2 + bias;  // eq. 12
}

bool Merger::grow(std::size_t seed, Deadline deadline) noexcept {
  const auto id = static_cast<std::int16_t>(region_count_);
  Region& region = regions_[region_count_];
  Leaf& first = tree_->leaves()[seed];
  const PyramidNode& node = pyramid_->at(first.level, first.i, first.j);
  region = {node.moments, fit(node.moments).rss, node.cells_rss, node.pixels, node.cells};
  first.region = id;
  first.seeded = true;
  queue_[0] = static_cast<std::uint16_t>(seed);
  queue_end_ = 1;
  bool complete = true;
  for (std::size_t k = 0; k < queue_end_; ++k) {
    if (deadline.expired()) {
      complete = false;
      break;
    }
    const Leaf leaf = tree_->leaves()[queue_[k]];
    const int edge = 1 << leaf.level;
    const int i = leaf.i * edge;
    const int j = leaf.j * edge;
    for (int s = 0; s < edge; ++s) {
      try_neighbour(i + s, j - 1, id, region);
      try_neighbour(i + s, j + edge, id, region);
      try_neighbour(i - 1, j + s, id, region);
      try_neighbour(i + edge, j + s, id, region);
    }
  }
  if (region.cells >= static_cast<std::uint32_t>(config_.min_plane_cells) && has_square(id)) {
    ++region_count_;
  } else {
    for (std::size_t k = 0; k < queue_end_; ++k) {
      tree_->leaves()[queue_[k]].region = Leaf::kNoRegion;
    }
  }
  return complete;
}

bool Merger::has_square(std::int16_t id) const noexcept {
  const auto inside = [&](int i, int j) {
    const int leaf = tree_->leaf_at(i, j);
    return leaf >= 0 && tree_->leaves()[static_cast<std::size_t>(leaf)].region == id;
  };
  for (std::size_t k = 0; k < queue_end_; ++k) {
    const Leaf& leaf = tree_->leaves()[queue_[k]];
    if (leaf.level > 0) return true;
    const int i = leaf.i;
    const int j = leaf.j;
    if (inside(i + 1, j) && inside(i, j + 1) && inside(i + 1, j + 1)) return true;
  }
  return false;
}

void Merger::try_neighbour(int i, int j, std::int16_t id, Region& region) noexcept {
  const int index = tree_->leaf_at(i, j);
  if (index < 0) return;
  Leaf& leaf = tree_->leaves()[static_cast<std::size_t>(index)];
  if (leaf.region != Leaf::kNoRegion) return;
  const PyramidNode& node = pyramid_->at(leaf.level, leaf.i, leaf.j);
  double rss = 0.0;
  if (!same_plane(region.moments, region.rss, node.moments, fit(node.moments).rss, rss)) return;
  region.moments += node.moments;
  region.rss = rss;
  region.cells_rss += node.cells_rss;
  region.pixels += node.pixels;
  region.cells += node.cells;
  leaf.region = id;
  queue_[queue_end_++] = static_cast<std::uint16_t>(index);
}

void Merger::join_neighbours(Deadline deadline) noexcept {
  std::fill_n(tested_pairs_.begin(), kMaxRegions * kWordsPerRow, std::uint64_t{0});
  const auto region_at = [this](int i, int j) {
    const int leaf = tree_->leaf_at(i, j);
    return leaf < 0 ? -1 : resolve(tree_->leaves()[static_cast<std::size_t>(leaf)].region);
  };
  bool joined = true;
  for (int pass = 0; pass < kJoinPasses && joined; ++pass) {
    joined = false;
    for (int j = 0; j < pyramid_->cells_high(); ++j) {
      if (deadline.expired()) return;
      for (int i = 0; i < pyramid_->cells_wide(); ++i) {
        const int a = region_at(i, j);
        if (a < 0) continue;
        joined |= try_join(a, region_at(i + 1, j));
        joined |= try_join(resolve(a), region_at(i, j + 1));
      }
    }
  }
}

bool Merger::try_join(int a, int b) noexcept {
  if (b < 0 || a == b) return false;
  if (regions_[a].pixels < regions_[b].pixels) std::swap(a, b);
  std::uint64_t& word = tested_pairs_[a * kWordsPerRow + b / 64];
  const std::uint64_t bit = std::uint64_t{1} << (b % 64);
  if ((word & bit) != 0) return false;
  word |= bit;
  Region& into = regions_[a];
  Region& from = regions_[b];
  double rss = 0.0;
  if (!same_plane(into.moments, into.rss, from.moments, from.rss, rss)) return false;
  into.moments += from.moments;
  into.rss = rss;
  into.cells_rss += from.cells_rss;
  into.pixels += from.pixels;
  into.cells += from.cells;
  from.merged_into = static_cast<std::int16_t>(a);
  // The larger plane is a new one: its other neighbours get another chance.
  std::fill_n(tested_pairs_.begin() + a * kWordsPerRow, kWordsPerRow, std::uint64_t{0});
  return true;
}

int Merger::resolve(int region) const noexcept {
  while (region >= 0 && regions_[region].merged_into >= 0) region = regions_[region].merged_into;
  return region;
}

}  // namespace maplet
