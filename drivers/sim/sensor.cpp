// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/sim/sensor.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/sim/random.hpp"

namespace maplet::sim {
namespace {

constexpr double kBaselineM = 0.075;       // Kinect v1, projector to camera
constexpr double kKhoshelhamK = 1.425e-3;  // 1/m
constexpr double kHandaSd = 1.0 / 6.0;     // disparity units
constexpr double kShiftSdVgaPx = 0.5;
constexpr double kRounding = 1.0 / 12.0;  // variance of rounding to whole units
constexpr float kGrazingNone = 0.21F;     // cosine from which on depth may miss: 78 deg
constexpr float kGrazingAll = 0.10F;      // always misses: 84 deg
constexpr float kStep = 0.04F;            // relative depth step that counts as an edge
constexpr unsigned kEdgeMiss = 0x60;      // of 0x100: chance to miss at an edge

/// Draws are sums of bytes: two, of which 2 x 2 pixels are averaged, or four of one pixel's own.
struct ByteSum {
  int bytes;  ///< that make up one pixel's noise
  [[nodiscard]] float mean() const noexcept { return 127.5F * static_cast<float>(bytes); }
  [[nodiscard]] float sd() const noexcept {
    return std::sqrt(static_cast<float>(bytes) * (65536.0F - 1.0F) / 12.0F);
  }
};
constexpr ByteSum kSmooth{8};
constexpr ByteSum kOwn{4};

std::uint16_t two_bytes(std::uint64_t word) noexcept {
  return static_cast<std::uint16_t>((word & 0xff) + ((word >> 8) & 0xff));
}
std::uint16_t four_bytes(std::uint64_t word) noexcept {
  return static_cast<std::uint16_t>(two_bytes(word) + two_bytes(word >> 16));
}

std::uint16_t millimetres(float metres, const SimOptions& options) noexcept {
  if (!(metres >= static_cast<float>(options.min_m) &&
        metres <= static_cast<float>(options.max_m))) {
    return 0;
  }
  return static_cast<std::uint16_t>(static_cast<int>(metres * 1000.0F + 0.5F));
}

}  // namespace

Sensor::Sensor(const World& world, const CameraModel& camera, const SimOptions& options)
    : camera_{camera},
      options_{options},
      key_{mix(mix(static_cast<std::uint64_t>(options.seed), 0x5e2502),
               static_cast<std::uint64_t>(options.agent))},
      shadow_(static_cast<std::size_t>(camera.width_px)) {
  // A smaller image is the large one binned: disparity is still measured on the large one.
  const double to_vga = 640.0 / camera.width_px;
  units_m_ = static_cast<float>(8.0 * camera.fx_px * to_vga * kBaselineM);
  const double total = options.noise * kKhoshelhamK * static_cast<double>(units_m_);
  disparity_sd_ =
      static_cast<float>(options.handa ? options.noise * kHandaSd
                                       : std::sqrt(std::max(0.0, total * total - kRounding)));
  shift_sd_px_ = static_cast<float>(options.noise * kShiftSdVgaPx / to_vga);
  for (const Surface& surface : world.surfaces) plane_of_.push_back(surface.plane);
  const auto columns = static_cast<std::size_t>(camera.width_px);
  for (Draws* draws : {&now_, &above_}) {
    for (auto* row : {&draws->disparity, &draws->across, &draws->down, &draws->dice}) {
      row->resize(columns + 1);
    }
  }
  for (auto* row : {&noise_.disparity, &noise_.across, &noise_.down}) row->resize(columns);
  for (int u = 0; u < camera.width_px; ++u) {
    ray_x2_.push_back(static_cast<float>(std::pow((u - camera.cx_px) / camera.fx_px, 2)));
  }
  for (int v = 0; v < camera.height_px; ++v) {
    ray_y2_.push_back(static_cast<float>(std::pow((v - camera.cy_px) / camera.fy_px, 2)));
  }
}

NoiseModel Sensor::noise_model() const noexcept {
  NoiseModel model;
  const double sd = static_cast<double>(disparity_sd_);
  const double units = static_cast<double>(units_m_);
  // Without noise what is left is the rounding to mm, at 3 m as inverse depth.
  model.disparity_k = options_.noise > 0.0 ? std::sqrt(sd * sd + kRounding) / units : 0.29e-3 / 9.0;
  model.lateral_px = static_cast<double>(shift_sd_px_);
  model.disparity_step = 1.0 / units;
  if (options_.noise == 0.0) {
    model.correlated_px = 1.0;
    model.disparity_step = 0.0;
  }
  // So little noise hardly dithers the steps: neighbours err alike.
  if (options_.handa) model.correlated_px = 5.0;
  return model;
}

void Sensor::measure(const Raster& raster, std::uint64_t frame, std::uint16_t* depth_mm,
                     std::uint16_t* label) noexcept {
  if (options_.noise == 0.0) return measure_exact(raster, depth_mm, label);
  const std::uint64_t key = mix(key_, frame);
  draw_row(-1, key, above_);
  for (int v = 0; v < camera_.height_px; ++v) {
    draw_row(v, key, now_);
    make_noise();
    measure_row(raster, v, depth_mm, label);
    std::swap(now_, above_);
  }
}

void Sensor::measure_exact(const Raster& raster, std::uint16_t* depth_mm,
                           std::uint16_t* label) noexcept {
  const int count = camera_.width_px * camera_.height_px;
  for (int i = 0; i < count; ++i) {
    const std::int32_t s = raster.surface()[i];
    depth_mm[i] =
        s < 0 ? std::uint16_t{0} : millimetres(1.0F / raster.inverse_depth()[i], options_);
    label[i] = depth_mm[i] == 0 ? std::uint16_t{0} : plane_of_[static_cast<std::size_t>(s)];
  }
}

void Sensor::draw_row(int v, std::uint64_t key, Draws& draws) noexcept {
  const std::uint64_t row = key + static_cast<std::uint64_t>(v + 1) * 4096;
  const std::size_t columns = draws.dice.size();
  for (std::size_t u = 0; u < columns; ++u) {
    const std::uint64_t bits = mix(row + u);
    draws.disparity[u] = two_bytes(bits);
    draws.across[u] = two_bytes(bits >> 16);
    draws.down[u] = two_bytes(bits >> 32);
    draws.dice[u] = static_cast<std::uint16_t>(bits >> 48);
  }
  if (!options_.handa) return;
  for (std::size_t u = 0; u < columns; ++u) {
    const std::uint64_t bits = mix(row + 2048 + u);
    draws.disparity[u] = four_bytes(bits);
    draws.across[u] = four_bytes(bits >> 32);
    draws.down[u] = four_bytes(mix(bits));
  }
}

void Sensor::make_noise() noexcept {
  const std::size_t columns = noise_.disparity.size();
  const auto make = [&](const std::vector<std::uint16_t>& here,
                        const std::vector<std::uint16_t>& over, float sd, std::vector<float>& out) {
    const ByteSum sum = options_.handa ? kOwn : kSmooth;
    const float scale = sd / sum.sd();
    const float mean = sum.mean();
    const std::uint16_t* a = here.data();
    const std::uint16_t* b = over.data();
    float* to = out.data();
    if (options_.handa) {
      for (std::size_t u = 0; u < columns; ++u) to[u] = scale * (static_cast<float>(a[u]) - mean);
    } else {
      for (std::size_t u = 0; u < columns; ++u) {
        to[u] = scale * (static_cast<float>(a[u] + a[u + 1] + b[u] + b[u + 1]) - mean);
      }
    }
  };
  make(now_.disparity, above_.disparity, disparity_sd_, noise_.disparity);
  make(now_.across, above_.across, shift_sd_px_, noise_.across);
  make(now_.down, above_.down, shift_sd_px_, noise_.down);
}

/// Seen from the projector at the camera's right, a pixel lies in column u - 8 f b / Z / 8: where
/// something to its right already took that column, nearer to the camera, it is not lit.
void Sensor::find_shadow(const float* inverse) noexcept {
  const float pixels = units_m_ / 8.0F * static_cast<float>(camera_.width_px) / 640.0F;
  float taken = 1e9F;
  for (int u = camera_.width_px - 1; u >= 0; --u) {
    const float column = static_cast<float>(u) - pixels * inverse[u];
    shadow_[static_cast<std::size_t>(u)] = column > taken ? 1 : 0;
    taken = std::min(taken, column);
  }
}

/// Grazing angles and depth steps.
/// @param inverse  the row's exact inverse depth
/// @param w        inverse depth where the pixel reads, on a plane `distance` away
bool Sensor::misses(const float* inverse, int u, int v, float w, float distance) const noexcept {
  const auto i = static_cast<std::size_t>(u);
  const auto dice = static_cast<unsigned>(now_.dice[i]);
  // n . ray = -d w: so d w / |ray| is the cosine between the plane's normal and the ray.
  const float grazing =
      kGrazingAll + (kGrazingNone - kGrazingAll) * static_cast<float>(dice & 0xff) / 256.0F;
  const float slope = distance * w;
  const float ray2 = 1.0F + ray_x2_[i] + ray_y2_[static_cast<std::size_t>(v)];
  if (slope * slope < grazing * grazing * ray2) return true;
  if (dice >> 8 >= kEdgeMiss) return false;
  const float here = inverse[u];
  const float left = inverse[std::max(0, u - 1)];
  const float right = inverse[std::min(camera_.width_px - 1, u + 1)];
  return std::max(std::abs(left - here), std::abs(right - here)) > kStep * here;
}

void Sensor::measure_row(const Raster& raster, int v, std::uint16_t* depth_mm,
                         std::uint16_t* label) noexcept {
  const int width = camera_.width_px;
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(v) * width;
  const float* inverse = raster.inverse_depth() + row;
  if (options_.dropout) find_shadow(inverse);
  for (int u = 0; u < width; ++u) {
    const auto i = static_cast<std::size_t>(u);
    depth_mm[row + u] = 0;
    label[row + u] = 0;
    const float from_u = static_cast<float>(u) + noise_.across[i];
    const float from_v = static_cast<float>(v) + noise_.down[i];
    const int at_u = std::clamp(static_cast<int>(from_u + 0.5F), 0, width - 1);
    const int at_v = std::clamp(static_cast<int>(from_v + 0.5F), 0, camera_.height_px - 1);
    const std::int32_t s = raster.surface()[static_cast<std::ptrdiff_t>(at_v) * width + at_u];
    if (s < 0) continue;
    const Raster::Linear& plane = raster.linear(s);
    const float w = plane.a * from_u + plane.b * from_v + plane.c;
    if (options_.dropout && (shadow_[i] || misses(inverse, u, v, w, raster.distance(s)))) continue;
    const int units = static_cast<int>(units_m_ * w + noise_.disparity[i] + 0.5F);
    if (units < 1) continue;
    const std::uint16_t mm = millimetres(units_m_ / static_cast<float>(units), options_);
    depth_mm[row + u] = mm;
    label[row + u] = mm == 0 ? std::uint16_t{0} : plane_of_[static_cast<std::size_t>(s)];
  }
}

}  // namespace maplet::sim
