// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/frame/depth_frame.hpp"
#include "core/geometry/plane.hpp"
#include "core/patches/patch.hpp"

namespace maplet::eval {

/// How good the planes of many frames are. Members are sums and samples over all of them.
struct PatchScore {
  /// A true plane in the camera's frame by its label; nothing when it is not known.
  using TruePlane = std::function<std::optional<Plane>(std::uint16_t label)>;

  std::size_t frames = 0;
  double valid = 0, labelled = 0, within_3_sigma = 0;  ///< pixels
  std::vector<double> coverage;                        ///< labelled / valid of each frame
  // Hoover's counts at 80 % overlap, regions of 500 pixels and more.
  std::size_t regions = 0, correct = 0, over = 0, under = 0, missed = 0, noise = 0;
  // Of correct planes, and of patches whose pixels are all of one true plane.
  std::vector<double> angle_deg, offset_mm, plane_nees, patch_nees;

  /// What needs no truth.
  /// @param found  plane + 1 of each pixel, row by row; 0 = none
  void add(const DepthFrame& frame, const PatchSet& set, std::span<const std::uint16_t> found);
  /// And what does.
  void add_truth(const DepthFrame& frame, const PatchSet& set, std::span<const std::uint16_t> found,
                 std::span<const std::uint16_t> truth, const TruePlane& true_plane);
};

/// 0 for no values.
[[nodiscard]] double quantile(std::vector<double> values, double share);
[[nodiscard]] double mean(const std::vector<double>& values);

}  // namespace maplet::eval
