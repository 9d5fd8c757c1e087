// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/assign.hpp"

#include <cmath>

namespace maplet {

void assign_pixels(const ImageView<std::uint16_t>& depth, int u, int v, int columns, int rows,
                   const DepthScale& scale, float limit_steps, std::span<const LinearDepth> planes,
                   const std::uint8_t* names, std::uint8_t* out, int out_stride,
                   std::uint32_t* won) noexcept {
  for (int y = 0; y < rows; ++y) {
    const std::uint16_t* raw = depth.row(v + y) + u;
    std::uint8_t* labels = out + (v + y) * out_stride + u;
    for (int x = 0; x < columns; ++x) {
      labels[x] = 0xFF;
      if (!scale.valid(raw[x])) continue;
      const float w = scale.steps_times_raw / static_cast<float>(raw[x]);
      float best = limit_steps;
      std::size_t winner = planes.size();
      for (std::size_t c = 0; c < planes.size(); ++c) {
        const LinearDepth& p = planes[c];
        const float residual = std::fabs(
            w - (p.corner + p.per_v * static_cast<float>(y) + p.per_u * static_cast<float>(x)));
        if (residual < best) {
          best = residual;
          winner = c;
        }
      }
      if (winner == planes.size()) continue;
      labels[x] = names[winner];
      ++won[winner];
    }
  }
}

}  // namespace maplet
