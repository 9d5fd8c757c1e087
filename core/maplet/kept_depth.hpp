// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/frame/image_size.hpp"
#include "core/geometry/camera_model.hpp"
#include "core/patches/patch.hpp"

namespace maplet {

/// A keyframe's depth image in a byte a pixel: its maplet's cells are looked at through it, when it
/// is taken and when their planes have settled.
///
/// Blocks of 8 x 8 pixels hold their nearest depth and a shift; each pixel is 0 (no return) or
/// 1 + (depth - nearest) >> shift, in its block's 64 bytes. Exact where a block's depths are less
/// than 255 units apart, else within half a 255th of what they are apart.
///
/// Memory   1.06 bytes a pixel of the size given, in the arena.
/// Time     take: O(pixels), ~1 ns each; at: O(1), one or two cache lines. Threads  one.
class KeptDepth {
 public:
  KeptDepth(ImageSize most, Arena& arena);

  /// @param frame  not larger than given at start: what is outside is not kept
  void take(const DepthFrame& frame) noexcept;
  /// What patches say that the image was, where there is none.
  void draw(const PatchSet& set) noexcept;

  [[nodiscard]] const CameraModel& camera() const noexcept { return camera_; }
  /// @param u, v  a pixel of the image that was taken
  /// @return m along the axis; 0 = no return
  [[nodiscard]] float at(int u, int v) const noexcept {
    if (u >= kept_.width_px || v >= kept_.height_px) return 0.0F;
    const auto block = static_cast<std::size_t>((v / kSide) * blocks_across_ + u / kSide);
    const int code =
        codes_[block * kCodes + static_cast<std::size_t>((v % kSide) * kSide + u % kSide)];
    if (code == 0) return 0.0F;
    const Block& b = blocks_[block];
    return static_cast<float>(b.nearest + ((code - 1) << b.shift)) * metres_per_unit_;
  }

 private:
  static constexpr int kSide = 8;
  static constexpr std::size_t kCodes = std::size_t{kSide} * kSide;

  struct Block {
    std::uint16_t nearest;
    std::uint16_t shift;
  };

  template <class F>
  void keep(const CameraModel& camera, double metres_per_unit, F depth_of_row) noexcept;

  ImageSize most_;
  ImageSize kept_;
  int blocks_across_ = 0;
  float metres_per_unit_ = 0.001F;
  CameraModel camera_;
  std::span<Block> blocks_;
  std::span<std::uint8_t> codes_;
};

}  // namespace maplet
