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
constexpr float kContrast = 90.0F;      // tile levels of a full swing
constexpr float kPixelNoise = 1.5F;     // gray levels

int four_bytes(std::uint64_t word) noexcept {
  return static_cast<int>((word & 0xff) + ((word >> 8) & 0xff) + ((word >> 16) & 0xff) +
                          ((word >> 24) & 0xff));
}

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
void fill(std::vector<std::uint8_t>& texels, int side, Paint paint) {
  texels.resize(static_cast<std::size_t>(side * side));
  std::size_t i = 0;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const float value = paint(static_cast<float>(x) / static_cast<float>(side),
                                static_cast<float>(y) / static_cast<float>(side));
      texels[i++] = static_cast<std::uint8_t>(std::clamp(128.5F + kContrast * value, 0.0F, 255.0F));
    }
  }
}

void fill_floor_tiles(std::vector<std::uint8_t>& texels, int side, std::uint64_t seed) {
  const Octaves cloud{seed, 16, 4, 1};
  constexpr int kTiles = 5;
  fill(texels, side, [&](float x, float y) {
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

/// Blocks of print and pictures: steps of a few gray values, as strong as ink on paper.
void fill_poster(std::vector<std::uint8_t>& texels, int side, std::uint64_t seed) {
  const Lattice picture{seed, 14, 14};
  const Octaves detail{seed ^ 0xf17e, 28, 4, 1};
  constexpr int kColumns = 16;
  constexpr int kLines = 96;
  fill(texels, side, [&](float x, float y) {
    const auto column = static_cast<std::uint64_t>(x * kColumns);
    const auto block = static_cast<std::uint64_t>(y * 12) * kColumns + column;
    const auto line = static_cast<std::uint64_t>(y * kLines);
    const bool printed = mix(seed, block) % 3 == 0;
    const bool ink = printed && line % 2 == 0 && mix(seed ^ line, column) % 5 != 0;
    const float at = picture.at(x, y);
    const float tone = at > 0.3F ? 0.5F : at < -0.3F ? -0.6F : 0.0F;
    return printed ? (ink ? -0.7F : 0.35F) : tone + 0.5F * detail.at(x, y);
  });
}

void fill_texels(Material material, std::vector<std::uint8_t>& texels, int side,
                 std::uint64_t seed) {
  switch (material) {
    case Material::kPlaster: {
      const Octaves cloud{seed, 4, 6, 1};
      const Lattice specks{seed ^ 0x57ec, 160, 160};
      return fill(texels, side, [&](float x, float y) {
        return 0.3F * cloud.at(x, y) + (specks.at(x, y) > 0.75F ? -0.25F : 0.0F);
      });
    }
    case Material::kWallpaper: {
      const Octaves cloud{seed, 4, 5, 1};
      const Lattice print{seed ^ 0x9a9e, 24, 24};
      return fill(texels, side, [&](float x, float y) {
        const float at = print.at(x, y);
        return 0.3F * cloud.at(x, y) + (at > 0.35F ? 0.35F : at < -0.5F ? -0.3F : 0.0F);
      });
    }
    case Material::kCarpet: {
      const Octaves cloud{seed, 8, 6, 1};
      return fill(texels, side, [&](float x, float y) { return 0.9F * cloud.at(x, y); });
    }
    case Material::kTiles:
      return fill_floor_tiles(texels, side, seed);
    case Material::kPoster:
      return fill_poster(texels, side, seed);
    case Material::kWood: {
      const Octaves grain{seed, 2, 5, 6};
      return fill(texels, side, [&](float x, float y) { return 0.7F * grain.at(x, y); });
    }
    case Material::kCardboard: {
      const Octaves cloud{seed, 6, 5, 1};
      const Lattice print{seed ^ 0xca2d, 12, 12};
      return fill(texels, side, [&](float x, float y) {
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
  const Eigen::Vector3d light = Eigen::Vector3d{0.45, -0.7, 0.4}.normalized();
  for (const Surface& s : world.surfaces) {
    const Eigen::Vector3d n = s.along.cross(s.across).normalized();
    Random random{seed, 0xc0a7 + coats_.size()};
    const double lit = 0.70 + 0.30 * n.dot(light);
    coats_.push_back({static_cast<float>(random.uniform(0, 50)),
                      static_cast<float>(random.uniform(0, 50)),
                      static_cast<float>(225.0 * static_cast<double>(s.albedo) * lit),
                      &tiles_[static_cast<std::size_t>(s.material)]});
  }
  layouts_.resize(coats_.size());
  row_.resize(static_cast<std::size_t>(camera.width_px));
}

void Painter::make_tile(Material material, std::uint64_t seed, Tile& tile) {
  fill_texels(material, tile.levels[0], kTilePx, seed);
  for (int level = 1; level < kLevels; ++level) {
    const int side = kTilePx >> level;
    const auto& fine = tile.levels[static_cast<std::size_t>(level) - 1];
    auto& coarse = tile.levels[static_cast<std::size_t>(level)];
    coarse.resize(static_cast<std::size_t>(side * side));
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const std::uint8_t* p = fine.data() + (2 * y) * (2 * side) + 2 * x;
        coarse[static_cast<std::size_t>(y * side + x)] =
            static_cast<std::uint8_t>((p[0] + p[1] + p[2 * side] + p[2 * side + 1] + 2) / 4);
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
  const std::uint8_t* pixels = tile.levels[static_cast<std::size_t>(level)].data();
  const std::uint8_t* above = pixels + (iy & mask) * side;
  const std::uint8_t* below = pixels + ((iy + 1) & mask) * side;
  const int x0 = ix & mask;
  const int x1 = (ix + 1) & mask;
  const auto a = static_cast<float>(above[x0]);
  const auto b = static_cast<float>(below[x0]);
  const float top = a + fx * (static_cast<float>(above[x1]) - a);
  const float bottom = b + fx * (static_cast<float>(below[x1]) - b);
  return top + fy * (bottom - top) - 128.0F;
}

void Painter::lay_out(const Se3& T_world_camera) noexcept {
  const Eigen::Matrix3d R = T_world_camera.rotation();
  for (std::size_t i = 0; i < layouts_.size(); ++i) {
    const Surface& s = world_->surfaces[i];
    const Eigen::Vector3d from_corner = T_world_camera.t - s.corner;
    const auto line = [&](const Eigen::Vector3d& edge, float offset, float* out) {
      const Eigen::Vector3d e = edge.normalized();
      const Eigen::Vector3d in_camera = R.transpose() * e;
      const double a = in_camera.x() / camera_.fx_px;
      const double b = in_camera.y() / camera_.fy_px;
      out[0] = static_cast<float>(a);
      out[1] = static_cast<float>(b);
      out[2] = static_cast<float>(in_camera.z() - a * camera_.cx_px - b * camera_.cy_px);
      out[3] = static_cast<float>(e.dot(from_corner)) + offset;
    };
    line(s.along, coats_[i].along0, &layouts_[i].ax);
    line(s.across, coats_[i].across0, &layouts_[i].ay);
  }
}

void Painter::paint_run(std::int32_t surface, int v, int begin, int end, const float* inverse,
                        float* out) const noexcept {
  const Coat& coat = coats_[static_cast<std::size_t>(surface)];
  const Layout& at = layouts_[static_cast<std::size_t>(surface)];
  const float x0 = at.bx * static_cast<float>(v) + at.cx;
  const float y0 = at.by * static_cast<float>(v) + at.cy;
  const float texels_m = 1.4F / (static_cast<float>(camera_.fx_px) * kTexelM);
  const auto contrast = static_cast<float>(options_.texture);
  for (int u = begin; u < end; ++u) {
    const float z = 1.0F / inverse[u];
    const float x = (x0 + at.ax * static_cast<float>(u)) * z + at.dx;
    const float y = (y0 + at.ay * static_cast<float>(u)) * z + at.dy;
    // The level whose texel is about a pixel wide, and the coarse layer's.
    const int level = std::clamp(exponent(z * texels_m), 0, kLevels - 1);
    const float fine = sample(*coat.tile, level, x, y);
    const float coarse =
        sample(*coat.tile, std::max(0, level - 2), y * kCoarse + 3.0F, x * kCoarse);
    out[u] = coat.shade + contrast * (0.5F * fine + 0.6F * coarse);
  }
}

void Painter::paint(const Raster& raster, const Se3& T_world_camera, std::uint64_t frame,
                    std::uint8_t* gray) noexcept {
  lay_out(T_world_camera);
  const int width = camera_.width_px;
  const std::uint64_t key = mix(mix(static_cast<std::uint64_t>(options_.seed), 0x92a1),
                                frame * 256 + static_cast<std::uint64_t>(options_.agent));
  const float noise = options_.noise > 0.0 ? kPixelNoise / 147.8F : 0.0F;
  for (int v = 0; v < camera_.height_px; ++v) {
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(v) * width;
    const std::int32_t* surface = raster.surface() + row;
    for (int begin = 0; begin < width;) {
      int end = begin + 1;
      while (end < width && surface[end] == surface[begin]) ++end;
      if (surface[begin] < 0) {
        std::fill(row_.begin() + begin, row_.begin() + end, 0.0F);
      } else {
        paint_run(surface[begin], v, begin, end, raster.inverse_depth() + row, row_.data());
      }
      begin = end;
    }
    for (int u = 0; u < width; u += 2) {
      const std::uint64_t dice = mix(key + static_cast<std::uint64_t>(row + u));
      for (int k = 0; k < 2; ++k) {
        const float grain = noise * (static_cast<float>(four_bytes(dice >> (32 * k))) - 510.0F);
        const float value = row_[static_cast<std::size_t>(u + k)] + grain;
        gray[row + u + k] =
            static_cast<std::uint8_t>(static_cast<int>(std::clamp(value + 0.5F, 0.0F, 255.0F)));
      }
    }
  }
}

}  // namespace maplet::sim
