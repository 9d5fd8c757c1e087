// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/patches/moments.hpp"
#include "core/patches/patch_config.hpp"
#include "core/patches/pyramid.hpp"
#include "core/patches/quadtree.hpp"

namespace maplet {

/// Connected leaves that are flat together.
struct Region {
  Moments moments;
  double rss = 0.0;        ///< of its fit, steps^2
  double cells_rss = 0.0;  ///< sum of its finest cells' residuals, steps^2
  std::uint32_t pixels = 0;
  std::uint32_t cells = 0;
  std::int16_t merged_into = -1;  ///< another region, or -1
  int joined_in = -1;             ///< the last pass that made it larger
};

/// Merges leaves into planes: grows from the largest leaf outwards, then joins grown neighbours.
/// Two sets of pixels are one plane when one fit explains them as well as two.
///
/// Memory   fixed, from the arena: kMaxRegions regions.
/// Time     O(leaves + cells); overruns its deadline by one test at most.
/// Threads  one at a time.
/// Math     docs/math/patches.md, eq. 11-13
class Merger {
 public:
  static constexpr std::size_t kMaxRegions = 512;

  Merger(const PatchConfig& config, Arena& arena);

  /// Sets the region of each leaf.
  /// @param least_pixels  a plane with fewer is none
  Stop run(const Pyramid& pyramid, Quadtree& tree, double correlated_px, std::uint32_t least_pixels,
           Deadline deadline) noexcept;

  [[nodiscard]] std::span<const Region> regions() const noexcept {
    return regions_.first(region_count_);
  }
  /// The region that a leaf's region has become.
  [[nodiscard]] int resolve(int region) const noexcept;

 private:
  [[nodiscard]] bool same_plane(const Moments& a, double rss_a, const Moments& b, double rss_b,
                                Fit& both) const noexcept;
  [[nodiscard]] bool grow(std::size_t seed, Deadline deadline) noexcept;
  void set_fit(const Fit& f) noexcept;
  void try_neighbour(std::size_t leaf, std::int16_t id, Region& region) noexcept;
  void join_neighbours(Deadline deadline) noexcept;
  void note_pair(int a, int leaf) noexcept;
  bool try_join(int a, int b) noexcept;

  PatchConfig config_;
  std::span<Region> regions_;
  std::span<std::uint16_t> queue_;  ///< leaves of the growing region
  struct Pair {
    std::int16_t a, b;
  };
  std::span<std::uint64_t> known_pairs_;  ///< bit matrix of regions
  std::span<Pair> pairs_;                 ///< regions that touch
  std::size_t pair_count_ = 0;
  Fit fit_;                           ///< of the growing region
  const Pyramid* pyramid_ = nullptr;  ///< during run()
  Quadtree* tree_ = nullptr;          ///< during run()
  double step_limit_ = 1.0;           ///< of the growing region, steps^2
  double correlated_px_ = 1.0;
  std::uint32_t least_pixels_ = 0;
  unsigned looks_ = 0;
  std::size_t region_count_ = 0, queue_end_ = 0;
};

}  // namespace maplet
