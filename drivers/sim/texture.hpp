// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "drivers/sim/options.hpp"
#include "drivers/sim/raster.hpp"
#include "drivers/sim/world.hpp"

namespace maplet::sim {

/// Paints the gray image: for each surface a tile of its material laid out in metres (two layers
/// of different scale and place, so that it does not repeat visibly), lit from above and one side.
///
/// Memory   one pyramid of tiles a material, made by the constructor when gray is asked for.
/// Time     O(pixels).
class Painter {
 public:
  Painter(const World& world, const CameraModel& camera, const SimOptions& options);

  void paint(const Raster& raster, const Se3& T_world_camera, std::uint64_t frame,
             std::uint8_t* gray) noexcept;

 private:
  static constexpr int kLevels = 8;
  static constexpr int kTilePx = 512;

  /// A square that repeats, contrast about 128, and its halvings.
  struct Tile {
    std::array<std::vector<std::uint8_t>, kLevels> levels;
  };
  /// What a surface is painted with.
  struct Coat {
    float along0, across0;  ///< where its texture begins, m
    float shade;            ///< gray without texture
    const Tile* tile;
  };
  /// Where pixel (u, v) lies on a surface, m along its edges: (a u + b v + c) Z + d.
  struct Layout {
    float ax, bx, cx, dx;
    float ay, by, cy, dy;
  };

  void make_tile(Material material, std::uint64_t seed, Tile& tile);
  void lay_out(const Se3& T_world_camera) noexcept;
  [[nodiscard]] static float sample(const Tile& tile, int level, float x_m, float y_m) noexcept;
  void paint_run(std::int32_t surface, int v, int begin, int end, const float* inverse,
                 float* out) const noexcept;

  const World* world_;
  CameraModel camera_;
  SimOptions options_;
  std::vector<Tile> tiles_;
  std::vector<Coat> coats_;
  std::vector<Layout> layouts_;
  std::vector<float> row_;
};

}  // namespace maplet::sim
