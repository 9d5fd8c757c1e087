// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/gray_pyramid.hpp"

#include <algorithm>
#include <cstring>

namespace maplet {

namespace {

constexpr int kMinSize = 32;  // of the finest level: below, there is nothing to align

// The camera of an image whose pixels are means of step x step pixels.
CameraModel reduced(const CameraModel& camera, int step) noexcept {
  return {
      camera.width_px / step, camera.height_px / step,           camera.fx_px / step,
      camera.fy_px / step,    (camera.cx_px + 0.5) / step - 0.5, (camera.cy_px + 0.5) / step - 0.5};
}

void halve(const std::uint8_t* from, std::ptrdiff_t stride, int width, int height,
           std::uint8_t* __restrict to) noexcept {
  for (int v = 0; v < height; ++v) {
    const std::uint8_t* a = from + 2 * v * stride;
    const std::uint8_t* b = a + stride;
    for (int u = 0; u < width; ++u) {
      const int sum = a[2 * u] + a[2 * u + 1] + b[2 * u] + b[2 * u + 1];
      to[u] = static_cast<std::uint8_t>((sum + 2) >> 2);
    }
    to += width;
  }
}

// Means of step x step pixels, for the larger steps of images beyond twice the finest level.
void reduce(const ImageView<std::uint8_t>& from, int step, int width, int height,
            std::uint8_t* to) noexcept {
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      int sum = 0;
      for (int y = 0; y < step; ++y) {
        const std::uint8_t* row = from.row(v * step + y) + u * step;
        for (int x = 0; x < step; ++x) sum += row[x];
      }
      *to++ = static_cast<std::uint8_t>((sum + step * step / 2) / (step * step));
    }
  }
}

}  // namespace

GrayPyramid::GrayPyramid(Arena& arena) {
  std::size_t size = std::size_t{kMaxWidth} * kMaxHeight;
  for (auto& level : pixels_) {
    level = arena.make_array<std::uint8_t>(size, "odometry/gray");
    size /= 4;
  }
}

void GrayPyramid::assign(const ImageView<std::uint8_t>& image, const CameraModel& camera) noexcept {
  filled_ = false;
  if (image.empty() || !camera.valid() || image.width_px != camera.width_px ||
      image.height_px != camera.height_px) {
    return;
  }
  const int step = std::max((image.width_px + kMaxWidth - 1) / kMaxWidth,
                            (image.height_px + kMaxHeight - 1) / kMaxHeight);
  CameraModel size = reduced(camera, step);
  if (size.width_px < kMinSize || size.height_px < kMinSize) return;
  if (step == 1) {
    for (int v = 0; v < size.height_px; ++v) {
      std::memcpy(pixels_[0].data() + v * size.width_px, image.row(v),
                  static_cast<std::size_t>(size.width_px));
    }
  } else if (step == 2) {
    halve(image.pixels, image.stride_px, size.width_px, size.height_px, pixels_[0].data());
  } else {
    reduce(image, step, size.width_px, size.height_px, pixels_[0].data());
  }
  levels_[0] = {pixels_[0].data(), size};
  for (std::size_t i = 1; i < levels_.size(); ++i) {
    const int stride = size.width_px;
    size = reduced(size, 2);
    halve(levels_[i - 1].pixels, stride, size.width_px, size.height_px, pixels_[i].data());
    levels_[i] = {pixels_[i].data(), size};
  }
  filled_ = true;
}

}  // namespace maplet
