// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace maplet::eval {

/// How a segmentation into planes compares with the true one (Hoover et al. 1996).
struct SegmentationScore {
  /// A found region and the true one it is, with T of both in common.
  struct Match {
    std::uint16_t found;   ///< label
    std::uint16_t truth;   ///< label
    std::uint32_t pixels;  ///< of the true region
  };

  std::size_t regions = 0;  ///< true ones
  std::vector<Match> correct;
  std::size_t over = 0;    ///< true regions found in several pieces
  std::size_t under = 0;   ///< found regions that cover several true ones
  std::size_t missed = 0;  ///< true regions that are nothing of the above
  std::size_t noise = 0;   ///< found regions that are nothing of the above
};

/// True regions are the 8-connected sets of equal labels of at least `min_px` pixels; found regions
/// are equal labels. 0 is no label on both sides.
///
/// @param overlap  T: share of either region that both must have in common, above 0.5
[[nodiscard]] SegmentationScore score_segmentation(std::span<const std::uint16_t> truth,
                                                   std::span<const std::uint16_t> found, int width,
                                                   double overlap = 0.8, int min_px = 500);

}  // namespace maplet::eval
