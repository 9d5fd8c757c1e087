// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/merger.hpp"

#include <algorithm>

namespace maplet {

namespace {

constexpr std::size_t kWordsPerRow = Merger::kMaxRegions / 64;
constexpr int kJoinPasses = 4;
/// Looking at the clock costs as much as a leaf.
constexpr unsigned kLeavesPerLook = 8;
constexpr std::size_t kMaxPairs = 4096;
/// A neighbour whose middle is farther from the plane than six sigmas is not asked further.
constexpr double kStepVariances = 36.0;

}  // namespace

Merger::Merger(const PatchConfig& config, Arena& arena)
    : config_{config},
      regions_{arena.make_array<Region>(kMaxRegions, "patches/regions")},
      queue_{arena.make_array<std::uint16_t>(Quadtree::kMaxLeaves, "patches/growing")},
      known_pairs_{
          arena.make_array<std::uint64_t>(kMaxRegions * kWordsPerRow, "patches/known pairs")},
      pairs_{arena.make_array<Pair>(kMaxPairs, "patches/pairs")} {}

Stop Merger::run(const Pyramid& pyramid, Quadtree& tree, double correlated_px,
                 std::uint32_t least_pixels, Deadline deadline) noexcept {
  pyramid_ = &pyramid;
  tree_ = &tree;
  correlated_px_ = correlated_px;
  region_count_ = 0;
  looks_ = 0;
  least_pixels_ = least_pixels;
  bool complete = true;
  for (int level = pyramid.levels() - 1; level >= Pyramid::kCellLevel && complete; --level) {
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
                        Fit& f) const noexcept {
  f = fit(a + b);
  const double more = (f.rss - rss_a - rss_b) / pyramid_->variance(f);  // eq. 11
  const double pixels = a.n * b.n / (a.n + b.n);
  const double bias = config_.merge_bias_sigmas * config_.merge_bias_sigmas * pixels;
  return more <= correlated_px_ * config_.merge_chi2 + bias;  // eq. 12
}

void Merger::set_fit(const Fit& f) noexcept {
  fit_ = f;
  step_limit_ = kStepVariances * pyramid_->variance(f);
}

bool Merger::grow(std::size_t seed, Deadline deadline) noexcept {
  const auto id = static_cast<std::int16_t>(region_count_);
  Region& region = regions_[region_count_];
  Leaf& first = tree_->leaves()[seed];
  const PyramidNode& node = pyramid_->at(first.level, first.i, first.j);
  region = {node.moments, first.rss, node.cells_rss, node.pixels, node.cells};
  set_fit(fit(region.moments));
  first.region = id;
  first.seeded = true;
  queue_[0] = static_cast<std::uint16_t>(seed);
  queue_end_ = 1;
  bool complete = true;
  for (std::size_t k = 0; k < queue_end_; ++k) {
    if (++looks_ % kLeavesPerLook == 0 && deadline.expired()) {
      complete = false;
      break;
    }
    const Leaf leaf = tree_->leaves()[queue_[k]];
    const int edge = 1 << leaf.level;
    const int i = leaf.i * edge;
    const int j = leaf.j * edge;
    int last[4] = {-1, -1, -1, -1};  // a large neighbour is asked once a side
    const auto ask = [&](int side, int x, int y) {
      const int index = tree_->leaf_at(x, y);
      if (index < 0 || index == last[side]) return;
      last[side] = index;
      try_neighbour(static_cast<std::size_t>(index), id, region);
    };
    for (int s = 0; s < edge; ++s) {
      ask(0, i + s, j - 1);
      ask(1, i + s, j + edge);
      ask(2, i - 1, j + s);
      ask(3, i + edge, j + s);
    }
  }
  if (region.pixels >= least_pixels_) {
    ++region_count_;
  } else {
    // Others may still take them; as a beginning each would only find the same again.
    for (std::size_t k = 0; k < queue_end_; ++k) {
      tree_->leaves()[queue_[k]].region = Leaf::kNoRegion;
      tree_->leaves()[queue_[k]].seeded = true;
    }
  }
  return complete;
}

void Merger::try_neighbour(std::size_t index, std::int16_t id, Region& region) noexcept {
  Leaf& leaf = tree_->leaves()[index];
  if (leaf.region != Leaf::kNoRegion) return;
  const PyramidNode& node = pyramid_->at(leaf.level, leaf.i, leaf.j);
  // A depth step needs no statistics.
  const Moments& m = node.moments;
  const double off =
      m.n * fit_.w0 + fit_.a * (m.u - m.n * fit_.u0) + fit_.b * (m.v - m.n * fit_.v0) - m.w;
  if (off * off > step_limit_ * m.n * m.n) return;
  Fit both;
  if (!same_plane(region.moments, region.rss, node.moments, leaf.rss, both)) return;
  set_fit(both);
  region.moments += node.moments;
  region.rss = both.rss;
  region.cells_rss += node.cells_rss;
  region.pixels += node.pixels;
  region.cells += node.cells;
  leaf.region = id;
  queue_[queue_end_++] = static_cast<std::uint16_t>(index);
}

void Merger::join_neighbours(Deadline deadline) noexcept {
  std::fill_n(known_pairs_.begin(), region_count_ * kWordsPerRow, std::uint64_t{0});
  pair_count_ = 0;
  for (const Leaf& leaf : tree_->leaves()) {
    if (leaf.region < 0) continue;
    const int edge = 1 << leaf.level;
    for (int s = 0; s < edge; ++s) {
      note_pair(leaf.region, tree_->leaf_at((leaf.i + 1) * edge, leaf.j * edge + s));
      note_pair(leaf.region, tree_->leaf_at(leaf.i * edge + s, (leaf.j + 1) * edge));
    }
  }
  // A joined plane is a new one: pairs that it is part of are asked again.
  bool joined = true;
  for (int pass = 0; pass < kJoinPasses && joined; ++pass) {
    joined = false;
    for (std::size_t k = 0; k < pair_count_; ++k) {
      if (k % 16 == 0 && deadline.expired()) return;
      const int a = resolve(pairs_[k].a);
      const int b = resolve(pairs_[k].b);
      if (pass > 0 && regions_[a].joined_in != pass - 1 && regions_[b].joined_in != pass - 1) {
        continue;
      }
      if (a == b || !try_join(a, b)) continue;
      regions_[resolve(a)].joined_in = pass;
      joined = true;
    }
  }
}

void Merger::note_pair(int a, int leaf) noexcept {
  if (leaf < 0) return;
  int b = tree_->leaves()[static_cast<std::size_t>(leaf)].region;
  if (b < 0 || a == b || pair_count_ == kMaxPairs) return;
  if (a > b) std::swap(a, b);
  std::uint64_t& word = known_pairs_[a * kWordsPerRow + b / 64];
  const std::uint64_t bit = std::uint64_t{1} << (b % 64);
  if ((word & bit) != 0) return;
  word |= bit;
  pairs_[pair_count_++] = {static_cast<std::int16_t>(a), static_cast<std::int16_t>(b)};
}

bool Merger::try_join(int a, int b) noexcept {
  if (regions_[a].pixels < regions_[b].pixels) std::swap(a, b);
  Region& into = regions_[a];
  Region& from = regions_[b];
  Fit both;
  if (!same_plane(into.moments, into.rss, from.moments, from.rss, both)) return false;
  into.moments += from.moments;
  into.rss = both.rss;
  into.cells_rss += from.cells_rss;
  into.pixels += from.pixels;
  into.cells += from.cells;
  from.merged_into = static_cast<std::int16_t>(a);
  return true;
}

int Merger::resolve(int region) const noexcept {
  while (region >= 0 && regions_[region].merged_into >= 0) region = regions_[region].merged_into;
  return region;
}

}  // namespace maplet
