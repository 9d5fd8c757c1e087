// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/kept_depth.hpp"

#include <algorithm>
#include <array>
#include <bit>

namespace maplet {

namespace {

std::size_t blocks_of(ImageSize size, int side) noexcept {
  const ImageSize blocks = size.decimated(side);
  return blocks.pixels();
}

}  // namespace

KeptDepth::KeptDepth(ImageSize most, Arena& arena)
    : most_{most},
      blocks_{arena.make_array<Block>(blocks_of(most, kSide), "maplet/kept depth, blocks")},
      codes_{arena.make_array<std::uint8_t>(kCodes * blocks_of(most, kSide),
                                            "maplet/kept depth, pixels")} {}

/// @param copy_row  (u, v, count, out): `count` depths from pixel (u, v) on
template <class F>
void KeptDepth::keep(const CameraModel& camera, double metres_per_unit, F copy_row) noexcept {
  camera_ = camera;
  metres_per_unit_ = static_cast<float>(metres_per_unit);
  kept_ = {std::min(camera.width_px, most_.width_px), std::min(camera.height_px, most_.height_px)};
  blocks_across_ = kept_.decimated(kSide).width_px;
  std::size_t index = 0;
  for (int v0 = 0; v0 < kept_.height_px; v0 += kSide) {
    for (int u0 = 0; u0 < kept_.width_px; u0 += kSide, ++index) {
      std::array<std::uint16_t, kCodes> depth{};
      const int columns = std::min(kSide, kept_.width_px - u0);
      const int rows = std::min(kSide, kept_.height_px - v0);
      for (int j = 0; j < rows; ++j)
        copy_row(u0, v0 + j, columns, &depth[static_cast<std::size_t>(j) * kSide]);
      // No return is 0, and the largest after this; so is what is beside the image.
      std::uint16_t before_nearest = 65535;
      std::uint16_t farthest = 0;
      for (const std::uint16_t d : depth) {
        before_nearest = std::min(before_nearest, static_cast<std::uint16_t>(d - 1));
        farthest = std::max(farthest, d);
      }
      const auto nearest = static_cast<std::uint16_t>(before_nearest + 1);
      const unsigned apart = farthest == 0 ? 0U : static_cast<unsigned>(farthest - nearest);
      const int shift = std::max(0, static_cast<int>(std::bit_width(apart + apart / 128)) - 8);
      const unsigned half = (1U << shift) / 2;
      blocks_[index] = {nearest, static_cast<std::uint16_t>(shift)};
      std::uint8_t* codes = &codes_[index * kCodes];
      for (std::size_t k = 0; k < kCodes; ++k) {
        const unsigned d = depth[k];
        codes[k] = static_cast<std::uint8_t>(d == 0 ? 0U : 1U + ((d - nearest + half) >> shift));
      }
    }
  }
}

void KeptDepth::take(const DepthFrame& frame) noexcept {
  CameraModel camera = frame.camera;
  camera.width_px = frame.depth.width_px;
  camera.height_px = frame.depth.height_px;
  keep(camera, frame.metres_per_unit, [&](int u, int v, int count, std::uint16_t* out) {
    std::copy_n(frame.depth.row(v) + u, count, out);
  });
}

void KeptDepth::draw(const PatchSet& set) noexcept {
  keep(set.camera, 0.001, [&](int u, int v, int count, std::uint16_t* out) {
    for (int i = 0; i < count; ++i) {
      const Patch* patch = set.patch_at(u + i, v);
      const double inverse_m = patch == nullptr ? 0.0 : patch->theta.dot(set.camera.ray(u + i, v));
      const double depth_mm = inverse_m > 0.0 ? 1000.0 / inverse_m : 0.0;
      out[i] = depth_mm < 65535.0 ? static_cast<std::uint16_t>(depth_mm + 0.5) : std::uint16_t{0};
    }
  });
}

}  // namespace maplet
