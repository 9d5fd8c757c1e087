// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/sim/texture.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "drivers/sim/random.hpp"

namespace maplet::sim {
namespace {

constexpr float kTexelM = 0.004F;
constexpr float kCoarse = 1.0F / 4.7F;  // the second layer's scale
constexpr double kContrast = 70.0;      // gray levels of a tile's full swing
constexpr double kPixelNoise = 1.5;     // gray levels

/// Floor of the binary logarithm of x > 0.
int exponent(float x) noexcept {
  return static_cast<int>(std::bit_cast<std::uint32_t>(x) >> 23) - 127;
}

/// Smooth noise that repeats: random values at the corners of cells_x x cells_y cells a tile, in
/// [-1, 1], eased between.
class Lattice {
 public:
  Lattice(std::uint64_t seed, int cells_x, int cells_y)
      : cells_x_{cells_x}, values_(static_cast<std::size_t>((cells_x + 1) * (cells_y + 1))) {
    for (int j = 0; j <= cells_y; ++j) {
      for (int i = 0; i <= cells_x; ++i) {
        const int corner = (j % cells_y) * cells_x + i % cells_x;
        values_[static_cast<std::size_t>(j * (cells_x + 1) + i)] =
            static_cast<float>(mix(seed, static_cast<std::uint64_t>(corner)) >> 40) * 0x1p-23F - 1;
      }
    }
    cells_y_ = cells_y;
  }
  /// @param x, y  in [0, 1) of the tile
  [[nodiscard]] float at(float x, float y) const noexcept {
    const float cx = x * static_cast<float>(cells_x_);
    const float cy = y * static_cast<float>(cells_y_);
    const int ix = static_cast<int>(cx);
    const int iy = static_cast<int>(cy);
    const auto ease = [](float t) { return t * t * (3 - 2 * t); };
    const float fx = ease(cx - static_cast<float>(ix));
    const float fy = ease(cy - static_cast<float>(iy));
    const float* low = values_.data() + iy * (cells_x_ + 1) + ix;
    const float* high = low + cells_x_ + 1;
    return (1 - fy) * ((1 - fx) * low[0] + fx * low[1]) + fy * ((1 - fx) * high[0] + fx * high[1]);
  }

 private:
  int cells_x_;
  int cells_y_ = 0;
  std::vector<float> values_;
};

/// Octaves of noise, the first of `first` cells a tile; `stretch` draws it out to grain.
class Octaves {
 public:
  Octaves(std::uint64_t seed, int first, int count, int stretch) {
    for (int i = 0; i < count; ++i, first *= 2) {
      layers_.emplace_back(seed + static_cast<std::uint64_t>(i), first, first * stretch);
    }
  }
  [[nodiscard]] float at(float x, float y) const noexcept {
    float sum = 0.0F;
    float weight = 0.5F;
    for (const Lattice& layer : layers_) {
      sum += weight * layer.at(x, y);
      weight *= 0.6F;
    }
    return sum;
  }

 private:
  std::vector<Lattice> layers_;
};

/// Calls paint(x, y) for each texel, x and y in [0, 1).
template <class Paint>
void fill(std::vector<float>& texels, int side, float scale, Paint paint) {
  texels.resize(static_cast<std::size_t>(side * side));
  std::size_t i = 0;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      texels[i++] = scale * paint(static_cast<float>(x) / static_cast<float>(side),
                                  static_cast<float>(y) / static_cast<float>(side));
    }
  }
}

void fill_floor_tiles(std::vector<float>& texels, int side, float scale, std::uint64_t seed) {
  const Octaves cloud{seed, 16, 4, 1};
  constexpr int kTiles = 5;
  fill(texels, side, scale, [&](float x, float y) {
    const float tx = x * kTiles;
    const float ty = y * kTiles;
    const auto cell =
        static_cast<std::uint64_t>(static_cast<int>(ty) * kTiles + static_cast<int>(tx));
    const float tone = static_cast<float>(mix(seed, cell) >> 40) * 0x1p-23F - 1;
    const bool grout = std::abs(tx - std::floor(tx) - 0.5F) > 0.485F ||
                       std::abs(ty - std::floor(ty) - 0.5F) > 0.485F;
    return (grout ? -0.6F : 0.0F) + 0.15F * tone + 0.35F * cloud.at(x, y);
  });
}

void fill_texels(Material material, std::vector<float>& texels, int side, float scale,
                 std::uint64_t seed) {
  switch (material) {
    case Material::kPlaster: {
      const Octaves cloud{seed, 4, 6, 1};
      return fill(texels, side, scale, [&](float x, float y) { return 0.35F * cloud.at(x, y); });
    }
    case Material::kWallpaper: {
      const Octaves cloud{seed, 4, 5, 1};
      const Lattice print{seed ^ 0x9a9e, 24, 24};
      return fill(texels, side, scale, [&](float x, float y) {
        const float at = print.at(x, y);
        return 0.3F * cloud.at(x, y) + (at > 0.35F ? 0.35F : at < -0.5F ? -0.3F : 0.0F);
      });
    }
    case Material::kCarpet: {
      const Octaves cloud{seed, 8, 6, 1};
      return fill(texels, side, scale, [&](float x, float y) { return 0.9F * cloud.at(x, y); });
    }
    case Material::kTiles:
      return fill_floor_tiles(texels, side, scale, seed);
    case Material::kWood: {
      const Octaves grain{seed, 2, 5, 6};
      return fill(texels, side, scale, [&](float x, float y) { return 0.7F * grain.at(x, y); });
    }
    case Material::kCardboard: {
      const Octaves cloud{seed, 6, 5, 1};
      const Lattice print{seed ^ 0xca2d, 12, 12};
      return fill(texels, side, scale, [&](float x, float y) {
        return 0.5F * cloud.at(x, y) + (print.at(x, y) > 0.55F ? -0.45F : 0.0F);
      });
    }
  }
}

}  // namespace

Painter::Painter(const World& world, const CameraModel& camera, const SimOptions& options)
    : world_{&world}, camera_{camera}, options_{options} {
  if (!options.gray) return;
  const auto seed = static_cast<std::uint64_t>(options.seed);
  tiles_.resize(kMaterials);
  for (int m = 0; m < kMaterials; ++m) {
    make_tile(static_cast<Material>(m), mix(seed, 0x711e + static_cast<std::uint64_t>(m)),
              tiles_[static_cast<std::size_t>(m)]);
  }
  const Eigen::Vector3d light = Eigen::Vector3d{0.35, -0.5, 0.8}.normalized();
  for (const Surface& s : world.surfaces) {
    const Eigen::Vector3d n = s.along.cross(s.across).normalized();
    Random random{seed, 0xc0a7 + coats_.size()};
    const double lit = 0.62 + 0.38 * n.dot(light);
    coats_.push_back({static_cast<float>(random.uniform(0, 50)),
                      static_cast<float>(random.uniform(0, 50)),
                      static_cast<float>(225.0 * static_cast<double>(s.albedo) * lit),
                      &tiles_[static_cast<std::size_t>(s.material)]});
  }
  row_.resize(static_cast<std::size_t>(camera.width_px));
}

void Painter::make_tile(Material material, std::uint64_t seed, Tile& tile) {
  fill_texels(material, tile.levels[0], kTilePx, static_cast<float>(kContrast * options_.texture),
              seed);
  for (int level = 1; level < kLevels; ++level) {
    const int side = kTilePx >> level;
    const auto& fine = tile.levels[static_cast<std::size_t>(level) - 1];
    auto& coarse = tile.levels[static_cast<std::size_t>(level)];
    coarse.resize(static_cast<std::size_t>(side * side));
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const float* p = fine.data() + (2 * y) * (2 * side) + 2 * x;
        coarse[static_cast<std::size_t>(y * side + x)] =
            0.25F * (p[0] + p[1] + p[2 * side] + p[2 * side + 1]);
      }
    }
  }
}

float Painter::sample(const Tile& tile, int level, float x_m, float y_m) noexcept {
  const int side = kTilePx >> level;
  const float scale = 1.0F / (kTexelM * static_cast<float>(1 << level));
  // Places are positive (offsets are), so truncation rounds down; the half texel centres levels.
  const float x = x_m * scale + static_cast<float>(side) - 0.5F;
  const float y = y_m * scale + static_cast<float>(side) - 0.5F;
  const int ix = static_cast<int>(x);
  const int iy = static_cast<int>(y);
  const float fx = x - static_cast<float>(ix);
  const float fy = y - static_cast<float>(iy);
  const int mask = side - 1;
  const float* pixels = tile.levels[static_cast<std::size_t>(level)].data();
  const float* above = pixels + (iy & mask) * side;
  const float* below = pixels + ((iy + 1) & mask) * side;
  const int x0 = ix & mask;
  const int x1 = (ix + 1) & mask;
  return (1 - fy) * ((1 - fx) * above[x0] + fx * above[x1]) +
         fy * ((1 - fx) * below[x0] + fx * below[x1]);
}

void Painter::paint_run(std::int32_t surface, const Se3& T_world_camera, int v, int begin, int end,
                        const float* inverse, float* out) const noexcept {
  const Surface& s = world_->surfaces[static_cast<std::size_t>(surface)];
  const Coat& coat = coats_[static_cast<std::size_t>(surface)];
  const Eigen::Vector3d ex = T_world_camera.q.conjugate() * s.along.normalized();
  const Eigen::Vector3d ey = T_world_camera.q.conjugate() * s.across.normalized();
  const Eigen::Vector3d from_corner = T_world_camera.t - s.corner;
  const Eigen::Vector3d ray0 = camera_.ray(0.0, v);
  const auto x0 = static_cast<float>(ex.dot(ray0));
  const auto y0 = static_cast<float>(ey.dot(ray0));
  const auto dx = static_cast<float>(ex.x() / camera_.fx_px);
  const auto dy = static_cast<float>(ey.x() / camera_.fx_px);
  const float ox =
      static_cast<float>(from_corner.dot(s.along.normalized())) + coat.along0 + kTexelM;
  const float oy =
      static_cast<float>(from_corner.dot(s.across.normalized())) + coat.across0 + kTexelM;
  const float texels_m = 1.0F / (static_cast<float>(camera_.fx_px) * kTexelM);
  for (int u = begin; u < end; ++u) {
    const float z = 1.0F / inverse[u];
    const float x = (x0 + dx * static_cast<float>(u)) * z + ox;
    const float y = (y0 + dy * static_cast<float>(u)) * z + oy;
    // The level whose texel is about a pixel wide, and the coarse layer's.
    const int level = std::clamp(exponent(z * texels_m * 1.4F), 0, kLevels - 1);
    out[u] = coat.shade + 0.6F * sample(*coat.tile, level, x, y) +
             0.7F * sample(*coat.tile, std::max(0, level - 2), y * kCoarse + 3.0F, x * kCoarse);
  }
}

void Painter::paint(const Raster& raster, const Se3& T_world_camera, std::uint64_t frame,
                    std::uint8_t* gray) noexcept {
  const int width = camera_.width_px;
  const std::uint64_t key = mix(mix(static_cast<std::uint64_t>(options_.seed), 0x92a1),
                                frame * 256 + static_cast<std::uint64_t>(options_.agent));
  const float noise = options_.noise > 0.0 ? static_cast<float>(kPixelNoise / 147.8) : 0.0F;
  for (int v = 0; v < camera_.height_px; ++v) {
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(v) * width;
    const std::int32_t* surface = raster.surface() + row;
    for (int begin = 0; begin < width;) {
      int end = begin + 1;
      while (end < width && surface[end] == surface[begin]) ++end;
      if (surface[begin] < 0) {
        std::fill(row_.begin() + begin, row_.begin() + end, 0.0F);
      } else {
        paint_run(surface[begin], T_world_camera, v, begin, end, raster.inverse_depth() + row,
                  row_.data());
      }
      begin = end;
    }
    for (int u = 0; u < width; ++u) {
      const std::uint64_t dice = mix(key + static_cast<std::uint64_t>(row + u));
      const auto sum = static_cast<float>((dice & 0xff) + ((dice >> 8) & 0xff) +
                                          ((dice >> 16) & 0xff) + ((dice >> 24) & 0xff));
      const float value = row_[static_cast<std::size_t>(u)] + noise * (sum - 510.0F);
      gray[row + u] = static_cast<std::uint8_t>(std::clamp(value + 0.5F, 0.0F, 255.0F));
    }
  }
}

}  // namespace maplet::sim
