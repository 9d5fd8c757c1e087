// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/field.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/frame/image_size.hpp"

namespace maplet {

struct DecimatorConfig {
  int step = 1;

  static constexpr Field<DecimatorConfig> kFields[] = {
      {"decimate", &DecimatorConfig::step, 1, 4, "Keep every n-th pixel of every n-th row",
       "1|2|4"},
  };
};

/// Keeps every n-th pixel of every n-th row (nearest pixel, no averaging: depths at an edge must
/// not be mixed).
///
/// Memory  one image of the decimated size of each kind, from the arena; none for step 1.
/// Time    one pass over the kept pixels.
class Decimator {
 public:
  Decimator(const DecimatorConfig& config, Arena& arena, const ImageSize& largest = kLargestImage);

  /// @return the frame itself for step 1; otherwise a loan until the next call. A frame that is
  ///   larger than `largest` comes back empty.
  [[nodiscard]] DepthFrame run(const DepthFrame& frame) noexcept;

 private:
  int step_;
  std::span<std::uint16_t> depth_;
  std::span<std::uint8_t> gray_;
};

}  // namespace maplet
