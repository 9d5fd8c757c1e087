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
constexpr double kRounding = 1.0 / 12.0;   // variance of rounding to whole units
constexpr float kGrazingNone = 0.21F;      // cosine from which on depth may miss: 78 deg
constexpr float kGrazingAll = 0.10F;       // always misses: 84 deg
constexpr float kStep = 0.04F;             // relative depth step that counts as an edge
constexpr std::uint64_t kEdgeMiss = 0x60;  // of 0x100: chance to miss at an edge

// Sums of bytes: four make a draw, a draw's mean and variance below; 2 x 2 draws are averaged.
constexpr float kDrawMean = 4 * 127.5F;
constexpr float kDrawVariance = 4 * (65536.0F - 1.0F) / 12.0F;

/// Sum of the four bytes of the low or of the high half.
std::uint16_t four_bytes(std::uint32_t word) noexcept {
  const std::uint32_t pairs = (word & 0x00ff00ffU) + ((word >> 8) & 0x00ff00ffU);
  return static_cast<std::uint16_t>((pairs & 0xffffU) + (pairs >> 16));
}

std::uint16_t millimetres(float metres, const SimOptions& options) noexcept {
  if (!(metres >= static_cast<float>(options.min_m) &&
        metres <= static_cast<float>(options.max_m))) {
    return 0;
  }
  return static_cast<std::uint16_t>(metres * 1000.0F + 0.5F);
}

}  // namespace

Sensor::Sensor(const World& world, const CameraModel& camera, const SimOptions& options)
    : world_{&world},
      camera_{camera},
      options_{options},
      key_{mix(mix(static_cast<std::uint64_t>(options.seed), 0x5e2502),
               static_cast<std::uint64_t>(options.agent))},
      smooth_{!options.handa},
      shadow_(static_cast<std::size_t>(camera.width_px)) {
  // A smaller image is the large one binned: disparity is still measured on the large one.
  const double to_vga = 640.0 / camera.width_px;
  units_m_ = static_cast<float>(8.0 * camera.fx_px * to_vga * kBaselineM);
  const double total = options.noise * kKhoshelhamK * static_cast<double>(units_m_);
  disparity_sd_ =
      static_cast<float>(options.handa ? options.noise * kHandaSd
                                       : std::sqrt(std::max(0.0, total * total - kRounding)));
  shift_sd_px_ = static_cast<float>(options.noise * kShiftSdVgaPx / to_vga);
  const auto columns = static_cast<std::size_t>(camera.width_px) + 1;
  for (Noise* noise : {&now_, &above_}) {
    for (auto* row : {&noise->disparity, &noise->across, &noise->down}) row->resize(columns);
  }
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
  if (options_.noise == 0.0 || options_.handa) model.correlated_px = 1.0;
  return model;
}

void Sensor::measure(const Raster& raster, std::uint64_t frame, std::uint16_t* depth_mm,
                     std::uint16_t* label) noexcept {
  if (options_.noise == 0.0) return measure_exact(raster, depth_mm, label);
  const std::uint64_t key = mix(key_, frame);
  draw_noise_row(-1, key, above_.disparity, above_.across, above_.down);
  for (int v = 0; v < camera_.height_px; ++v) {
    draw_noise_row(v, key, now_.disparity, now_.across, now_.down);
    measure_row(raster, v, key, depth_mm, label);
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
    label[i] =
        depth_mm[i] == 0 ? std::uint16_t{0} : world_->surfaces[static_cast<std::size_t>(s)].plane;
  }
}

void Sensor::draw_noise_row(int v, std::uint64_t key, std::vector<std::uint16_t>& disparity,
                            std::vector<std::uint16_t>& across,
                            std::vector<std::uint16_t>& down) noexcept {
  const std::uint64_t row = key + static_cast<std::uint64_t>(v + 1) * 4096;
  for (std::size_t u = 0; u < disparity.size(); ++u) {
    const std::uint64_t a = mix(row + 2 * u);
    const std::uint64_t b = mix(row + 2 * u + 1);
    disparity[u] = four_bytes(static_cast<std::uint32_t>(a));
    across[u] = four_bytes(static_cast<std::uint32_t>(a >> 32));
    down[u] = four_bytes(static_cast<std::uint32_t>(b));
  }
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

void Sensor::measure_row(const Raster& raster, int v, std::uint64_t key, std::uint16_t* depth_mm,
                         std::uint16_t* label) noexcept {
  const int width = camera_.width_px;
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(v) * width;
  const float* inverse = raster.inverse_depth();
  if (options_.dropout) find_shadow(inverse + row);
  const float spread = 1.0F / std::sqrt((smooth_ ? 4.0F : 1.0F) * kDrawVariance);
  const auto draw = [&](const std::vector<std::uint16_t>& here,
                        const std::vector<std::uint16_t>& over, std::size_t u) {
    if (!smooth_) return (static_cast<float>(here[u]) - kDrawMean) * spread;
    const int sum = here[u] + here[u + 1] + over[u] + over[u + 1];
    return (static_cast<float>(sum) - 4.0F * kDrawMean) * spread;
  };
  for (int u = 0; u < width; ++u) {
    const auto i = static_cast<std::size_t>(u);
    depth_mm[row + u] = 0;
    label[row + u] = 0;
    const float shifted_u =
        static_cast<float>(u) + shift_sd_px_ * draw(now_.across, above_.across, i);
    const float shifted_v = static_cast<float>(v) + shift_sd_px_ * draw(now_.down, above_.down, i);
    const int su = std::clamp(static_cast<int>(shifted_u + 0.5F), 0, width - 1);
    const int sv = std::clamp(static_cast<int>(shifted_v + 0.5F), 0, camera_.height_px - 1);
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(sv) * width + su;
    const std::int32_t s = raster.surface()[at];
    if (s < 0) continue;
    const Raster::Linear& plane = raster.linear(s);
    const float w = plane.a * shifted_u + plane.b * shifted_v + plane.c;
    if (options_.dropout) {
      if (shadow_[i]) continue;
      const std::uint64_t dice = mix(key ^ 0xd1ce, (static_cast<std::uint64_t>(v) << 32) | i);
      // n . ray = -d w: the cosine of the angle between the plane's normal and the ray.
      const float cosine = raster.distance(s) * w /
                           std::sqrt(1.0F + ray_x2_[i] + ray_y2_[static_cast<std::size_t>(v)]);
      const float grazing =
          kGrazingAll + (kGrazingNone - kGrazingAll) * static_cast<float>(dice & 0xff) / 256.0F;
      if (cosine < grazing) continue;
      const float left = inverse[row + std::max(0, u - 1)];
      const float right = inverse[row + std::min(width - 1, u + 1)];
      const float here = inverse[row + u];
      const float step = std::max(std::abs(left - here), std::abs(right - here));
      if (step > kStep * here && ((dice >> 8) & 0xff) < kEdgeMiss) continue;
    }
    const float units =
        std::floor(units_m_ * w + disparity_sd_ * draw(now_.disparity, above_.disparity, i) + 0.5F);
    if (!(units >= 1.0F)) continue;
    depth_mm[row + u] = millimetres(units_m_ / units, options_);
    if (depth_mm[row + u] != 0) {
      label[row + u] = world_->surfaces[static_cast<std::size_t>(s)].plane;
    }
  }
}

}  // namespace maplet::sim
