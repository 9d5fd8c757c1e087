// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/frame/decimator.hpp"

#include <algorithm>

namespace maplet {

namespace {

template <class Pixel>
ImageView<Pixel> decimate(const ImageView<Pixel>& in, int step, std::span<Pixel> storage) noexcept {
  if (in.empty()) return {};
  const int width = (in.width_px + step - 1) / step;
  const int height = (in.height_px + step - 1) / step;
  if (static_cast<std::size_t>(width) * static_cast<std::size_t>(height) > storage.size())
    return {};
  Pixel* out = storage.data();
  for (int v = 0; v < height; ++v) {
    const Pixel* row = in.row(v * step);
    for (int u = 0; u < width; ++u) *out++ = row[u * step];
  }
  return {storage.data(), width, height, width};
}

}  // namespace

Decimator::Decimator(const DecimatorConfig& config, Arena& arena, const ImageSize& largest)
    : step_{config.step} {
  if (step_ == 1) return;
  const std::size_t pixels = largest.decimated(step_).pixels();
  depth_ = arena.make_array<std::uint16_t>(pixels, "frame/decimated depth");
  gray_ = arena.make_array<std::uint8_t>(pixels, "frame/decimated gray");
}

DepthFrame Decimator::run(const DepthFrame& frame) noexcept {
  if (step_ == 1) return frame;
  DepthFrame out = frame;
  out.depth = decimate(frame.depth, step_, depth_);
  out.gray = decimate(frame.gray, step_, gray_);
  out.camera = frame.camera.decimated(step_);
  // Pixels that are kept lie farther apart.
  out.noise.correlated_px = std::max(1.0, frame.noise.correlated_px / (step_ * step_));
  out.noise.lateral_px = frame.noise.lateral_px / step_;
  // Intensities are smoothed by whoever aligns them: every n-th pixel alone would be aliased.
  if (!frame.gray.empty() && frame.gray_beside.pixels.empty()) {
    out.gray_beside = {frame.gray, frame.camera, Se3{}};
  }
  return out;
}

}  // namespace maplet
