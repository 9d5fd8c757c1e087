// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/patches/merger.hpp"
#include "core/patches/patch.hpp"
#include "core/patches/patch_config.hpp"
#include "core/patches/pyramid.hpp"
#include "core/patches/quadtree.hpp"
#include "core/patches/refiner.hpp"
#include "core/patches/step_bias.hpp"

namespace maplet {

/// Depth pixels -> planar patches -> connected planes.
///
/// Memory   fixed, from the arena; run() allocates nothing.
/// Time     O(pixels) once, then O(1) a node; overruns its deadline by one node or one row of cells
///          at most. Any cut leaves a valid result.
/// Threads  one at a time.
/// Math     docs/math/patches.md
class PatchExtractor {
 public:
  PatchExtractor(const PatchConfig& config, Arena& arena, const ImageSize& largest = kLargestImage);

  /// Any frame has a result: sizes over the limits, cameras without focal length and frames without
  /// a return give an empty one.
  /// @return valid until the next call
  [[nodiscard]] const PatchSet& run(const DepthFrame& frame, Deadline deadline) noexcept;

  /// Plane of each pixel of the last frame plus 1, row by row; 0 = none or no return. With the
  /// second look these are finer than PatchSet's cells.
  void write_labels(const DepthFrame& frame, std::span<std::uint16_t> out) const noexcept {
    refiner_.write_labels(frame, out);
  }

 private:
  /// When each stage has to hand on, and how finely the image is read for it.
  struct Plan {
    Pyramid::Grain grain;
    bool finest = true;
    Deadline fill, split, merge;
  };
  /// What a plane's patches add up to.
  struct Tally {
    const Candidate* from = nullptr;
    double noise_power = 1.0;  ///< eq. 19
    double gray = 0.0;         ///< times area
    double pixels = 0.0;
    bool waves = false;  ///< disparity steps along it matter
    StepWave wave = {};
  };
  [[nodiscard]] Plan plan(const DepthFrame& frame, Deadline deadline) const noexcept;
  /// The end of the second look.
  [[nodiscard]] Deadline before_writing(Deadline deadline) const noexcept;
  void nominate_planes() noexcept;
  void name_cells() noexcept;
  void emit_planes() noexcept;
  void emit_plane(std::size_t candidate) noexcept;
  void emit_patches(const DepthFrame& frame, Deadline deadline) noexcept;
  void finish_planes(const DepthFrame& frame) noexcept;
  [[nodiscard]] double patch_noise(const Leaf& leaf, const PyramidNode& node,
                                   const Fit& f) const noexcept;
  void emit_patch(const Leaf& leaf, std::int16_t plane, const DepthFrame& frame) noexcept;
  void add_to_plane(const Patch& patch, const Moments& moments) noexcept;
  [[nodiscard]] std::int16_t candidate_of(const Leaf& leaf) const noexcept;
  [[nodiscard]] Eigen::Matrix3d information(const Moments& moments,
                                            double noise_power) const noexcept;

  PatchConfig config_;
  Pyramid pyramid_;
  Quadtree tree_;
  Merger merger_;
  Refiner refiner_;
  PixelFrame pixel_frame_{CameraModel{1, 1, 1.0, 1.0, 0.0, 0.0}};
  StepBias step_bias_;
  double correlated_px_ = 1.0;
  std::size_t candidate_count_ = 0;
  std::span<std::int16_t> candidate_of_region_;
  std::span<std::int16_t> largest_;             ///< regions, the largest first
  std::span<std::int16_t> plane_of_candidate_;  ///< index into the result, or kNoPlane
  std::span<Tally> tally_;                      ///< of the result's planes
  Arena::Owned<PatchSet> out_;
};

}  // namespace maplet
