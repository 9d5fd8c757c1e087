// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/geometry/camera_model.hpp"

namespace maplet {

/// A gray image at three sizes, each half of the one before: the finest is at most kMaxWidth wide.
///
/// Memory  fixed, from the arena: 100 kB.
/// Time    assign(): one pass over the image.
/// Math    docs/math/odometry.md, section "Gray"
class GrayPyramid {
 public:
  static constexpr int kLevels = 3;
  static constexpr int kMaxWidth = 320;
  static constexpr int kMaxHeight = 256;

  struct Level {
    const std::uint8_t* pixels = nullptr;
    CameraModel camera;  ///< size is the level's
  };

  explicit GrayPyramid(Arena& arena);

  /// Takes the image; a small, missing or oversized one leaves the pyramid empty.
  void assign(const ImageView<std::uint8_t>& image, const CameraModel& camera) noexcept;
  void clear() noexcept { filled_ = false; }

  [[nodiscard]] bool empty() const noexcept { return !filled_; }
  /// 0 is the finest.
  [[nodiscard]] const Level& level(int index) const noexcept {
    return levels_[static_cast<std::size_t>(index)];
  }

 private:
  std::array<std::span<std::uint8_t>, kLevels> pixels_;
  std::array<Level, kLevels> levels_;
  bool filled_ = false;
};

}  // namespace maplet
