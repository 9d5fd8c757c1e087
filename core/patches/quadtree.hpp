// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/geometry/camera_model.hpp"
#include "core/patches/moments.hpp"
#include "core/patches/patch_config.hpp"
#include "core/patches/pyramid.hpp"

namespace maplet {

/// A node of the pyramid that is flat.
struct Leaf {
  static constexpr std::int16_t kNoRegion = -1;

  std::uint16_t i = 0, j = 0;  ///< at its level
  std::uint8_t level = 0;
  bool seeded = false;              ///< already tried as the beginning of a plane
  std::int16_t region = kNoRegion;  ///< of the merger
  double rss = 0.0;                 ///< of its fit, steps^2
};

/// Best-first refinement: of all nodes that are not flat, the one whose split explains most of the
/// residual is split first.
///
/// Memory   fixed, from the arena: kMaxLeaves leaves and a heap of all nodes.
/// Time     O(1) a node; overruns its deadline by one node at most.
/// Threads  one at a time.
/// Math     docs/math/patches.md, eq. 7-9
class Quadtree {
 public:
  static constexpr std::size_t kMaxLeaves = 8192;

  Quadtree(const PatchConfig& config, Arena& arena);

  /// @param correlated_px  pixels that tell as much as one independent one
  Stop run(Pyramid& pyramid, const CameraModel& camera, double correlated_px,
           Deadline deadline) noexcept;

  [[nodiscard]] std::span<Leaf> leaves() noexcept { return leaves_.first(leaf_count_); }
  /// Leaves of the size of a cell or more.
  [[nodiscard]] std::size_t patch_count() const noexcept { return patch_count_; }
  /// Pixels that tell a plane as much as one independent one. Measured over the frame's leaves, the
  /// model is the prior.
  [[nodiscard]] double correlated_px() const noexcept;
  /// Variance of a pixel on a surface square to its ray, steps^2, measured inside the leaves'
  /// cells, but at most the model's.
  [[nodiscard]] double pixel_variance() const noexcept;
  /// Index of the leaf that covers a quarter of a cell, or -1. Outside the image: -1.
  [[nodiscard]] int leaf_at(int i, int j) const noexcept {
    return i < 0 || j < 0 || i >= width_ || j >= height_ ? -1 : leaf_of_cell_[j * width_ + i];
  }

 private:
  struct OpenNode {
    float gain;  ///< residual that the node's cells explain and the node does not, pixels
    std::uint16_t i, j;
    std::uint8_t level;
    [[nodiscard]] bool operator<(const OpenNode& o) const noexcept;
  };
  struct Cell {
    std::uint16_t i, j;
  };
  enum class Verdict : std::uint8_t { kFlat, kSplit, kDrop };

  /// Quarters of cells that are not flat. They add detail, not coverage: after everything coarser.
  Stop split_cells(Deadline deadline) noexcept;
  void consider(int level, int i, int j) noexcept;
  [[nodiscard]] Verdict judge(int level, int i, int j, float& gain, Fit& f) const noexcept;
  [[nodiscard]] bool seen_steeply(const Fit& f) const noexcept;
  void add_leaf(int level, int i, int j, const Fit& f) noexcept;

  PatchConfig config_;
  std::span<Leaf> leaves_;
  std::span<std::int16_t> leaf_of_cell_;
  std::span<Cell> cells_;  ///< that are not flat
  std::span<OpenNode> heap_;
  Pyramid* pyramid_ = nullptr;  ///< during run()
  PixelFrame pixel_frame_{CameraModel{1, 1, 1.0, 1.0, 0.0, 0.0}};
  double correlated_px_ = 1.0;
  double explained_ = 0.0;  ///< by the cells of all leaves, variances
  double explained_dof_ = 0.0;
  double inside_ = 0.0;  ///< residual of all leaves' cells without lateral noise, steps^2
  double inside_dof_ = 0.0;
  std::size_t leaf_count_ = 0, patch_count_ = 0, heap_size_ = 0, cell_count_ = 0;
  int width_ = 0, height_ = 0;
};

}  // namespace maplet
