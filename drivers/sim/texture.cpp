// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/sim/texture.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/sim/random.hpp"

namespace maplet::sim {
namespace {

constexpr float kTexelM = 0.004F;
constexpr float kCoarse = 1.0F / 4.7F;  // the second layer's scale
constexpr double kContrast = 70.0;      // gray levels of a tile's full swing
constexpr double kPixelNoise = 1.5;     // gray levels

/// Smooth noise of a lattice with `cells` a side that repeats, in [-1, 1].
double lattice(std::uint64_t seed, double x, double y, int cells_x, int cells_y) {
  const int ix = static_cast<int>(std::floor(x));
  const int iy = static_cast<int>(std::floor(y));
  const auto value = [&](int i, int j) {
    const auto at = static_cast<std::uint64_t>((j % cells_y) * 65536 + i % cells_x);
    return static_cast<double>(mix(seed, at) >> 40) * 0x1p-23 - 1.0;
  };
  const auto ease = [](double t) { return t * t * (3 - 2 * t); };
  const double fx = ease(x - ix);
  const double fy = ease(y - iy);
  return (1 - fy) * ((1 - fx) * value(ix, iy) + fx * value(ix + 1, iy)) +
         fy * ((1 - fx) * value(ix, iy + 1) + fx * value(ix + 1, iy + 1));
}

/// Octaves of lattice noise from `first` cells a tile; `stretch` makes it grain.
double octaves(std::uint64_t seed, double x, double y, int first, int count, int stretch) {
  double sum = 0.0;
  double weight = 0.5;
  int cells = first;
  for (int i = 0; i < count; ++i, cells *= 2, weight *= 0.6) {
    sum += weight * lattice(seed + static_cast<std::uint64_t>(i), x * cells, y * cells * stretch,
                            cells, cells * stretch);
  }
  return sum;
}

double pattern(Material material, std::uint64_t seed, double x, double y) {
  switch (material) {
    case Material::kPlaster:
      return 0.35 * octaves(seed, x, y, 4, 6, 1);
    case Material::kWallpaper: {
      const double print = lattice(seed ^ 0x9a9e, x * 24, y * 24, 24, 24);
      return 0.3 * octaves(seed, x, y, 4, 5, 1) + (print > 0.35 ? 0.35 : 0.0) -
             (print < -0.5 ? 0.3 : 0.0);
    }
    case Material::kCarpet:
      return 0.9 * octaves(seed, x, y, 8, 6, 1);
    case Material::kTiles: {
      const double edge_x = std::abs(x * 5 - std::floor(x * 5) - 0.5);
      const double edge_y = std::abs(y * 5 - std::floor(y * 5) - 0.5);
      const auto cell = static_cast<std::uint64_t>(std::floor(y * 5) * 5 + std::floor(x * 5));
      const double tone = static_cast<double>(mix(seed, cell) >> 40) * 0x1p-23 - 1.0;
      const double grout = edge_x > 0.485 || edge_y > 0.485 ? -0.6 : 0.0;
      return grout + 0.15 * tone + 0.35 * octaves(seed, x, y, 16, 4, 1);
    }
    case Material::kWood:
      return 0.7 * octaves(seed, x, y, 2, 5, 6);
    case Material::kCardboard:
      return 0.5 * octaves(seed, x, y, 6, 5, 1) +
             (lattice(seed ^ 0xca2d, x * 12, y * 12, 12, 12) > 0.55 ? -0.45 : 0.0);
  }
  return 0.0;
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
  auto& top = tile.levels[0];
  top.resize(std::size_t{kTilePx} * kTilePx);
  for (int y = 0; y < kTilePx; ++y) {
    for (int x = 0; x < kTilePx; ++x) {
      top[static_cast<std::size_t>(y * kTilePx + x)] =
          static_cast<float>(kContrast * options_.texture *
                             pattern(material, seed, static_cast<double>(x) / kTilePx,
                                     static_cast<double>(y) / kTilePx));
    }
  }
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
    const int level = std::clamp(std::ilogb(std::max(1.0F, z * texels_m * 1.4F)), 0, kLevels - 1);
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
