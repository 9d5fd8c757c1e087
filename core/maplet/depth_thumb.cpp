// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/depth_thumb.hpp"

#include <algorithm>

namespace maplet {

void DepthThumb::take(const DepthFrame& frame) noexcept {
  const ImageView<std::uint16_t>& image = frame.depth;
  if (image.empty()) return clear();
  step_px = std::max({1, (image.width_px + kMaxWidth - 1) / kMaxWidth,
                      (image.height_px + kMaxHeight - 1) / kMaxHeight});
  width = image.width_px / step_px;
  height = image.height_px / step_px;
  per_px = 1.0F / static_cast<float>(step_px);
  camera = frame.camera;
  metres_per_unit = static_cast<float>(frame.metres_per_unit);
  for (int j = 0; j < height; ++j) {
    const std::uint16_t* row = image.row(j * step_px + step_px / 2) + step_px / 2;
    std::uint16_t* out = &depth[static_cast<std::size_t>(j * width)];
    for (int i = 0; i < width; ++i) out[i] = row[i * step_px];
  }
}

}  // namespace maplet
