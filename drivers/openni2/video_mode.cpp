// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/openni2/video_mode.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <tuple>

#include "core/limits.hpp"

namespace maplet::openni2 {

namespace {

bool fits(const openni::VideoMode& mode) noexcept {
  return mode.getResolutionX() > 0 && mode.getResolutionY() > 0 &&
         mode.getResolutionX() <= static_cast<int>(kMaxWidthPx) &&
         mode.getResolutionY() <= static_cast<int>(kMaxHeightPx);
}

}  // namespace

std::optional<double> metres_per_unit(openni::PixelFormat format) noexcept {
  if (format == openni::PIXEL_FORMAT_DEPTH_1_MM) return 0.001;
  if (format == openni::PIXEL_FORMAT_DEPTH_100_UM) return 0.0001;
  return {};
}

bool becomes_gray(openni::PixelFormat format) noexcept {
  return format == openni::PIXEL_FORMAT_RGB888 || format == openni::PIXEL_FORMAT_GRAY8;
}

std::optional<openni::VideoMode> choose_depth_mode(const openni::SensorInfo& sensor,
                                                   const CameraModel& wanted) {
  constexpr int kWidth = 640, kRate = 30;
  const auto& modes = sensor.getSupportedVideoModes();
  const auto cost = [&](const openni::VideoMode& mode) {
    return std::tuple{std::abs(mode.getResolutionX() - kWidth),
                      mode.getPixelFormat() != openni::PIXEL_FORMAT_DEPTH_1_MM,
                      std::abs(mode.getFps() - kRate)};
  };
  std::optional<openni::VideoMode> best;
  for (int i = 0; i < modes.getSize(); ++i) {
    const openni::VideoMode& mode = modes[i];
    if (!fits(mode) || !metres_per_unit(mode.getPixelFormat()) || mode.getFps() <= 0) continue;
    if (wanted.width_px > 0 &&
        (mode.getResolutionX() != wanted.width_px || mode.getResolutionY() != wanted.height_px)) {
      continue;
    }
    if (!best || cost(mode) < cost(*best)) best = mode;
  }
  return best;
}

std::optional<openni::VideoMode> choose_colour_mode(const openni::SensorInfo& sensor,
                                                    const openni::VideoMode& depth) {
  const auto& modes = sensor.getSupportedVideoModes();
  const auto cost = [&](const openni::VideoMode& mode) {
    return std::abs(mode.getFps() - depth.getFps());
  };
  std::optional<openni::VideoMode> best;
  for (int i = 0; i < modes.getSize(); ++i) {
    const openni::VideoMode& mode = modes[i];
    if (!becomes_gray(mode.getPixelFormat()) || mode.getResolutionX() != depth.getResolutionX() ||
        mode.getResolutionY() != depth.getResolutionY()) {
      continue;
    }
    if (!best || cost(mode) < cost(*best)) best = mode;
  }
  return best;
}

std::string list_modes(const openni::SensorInfo& sensor) {
  const auto& modes = sensor.getSupportedVideoModes();
  std::string text;
  for (int i = 0; i < modes.getSize(); ++i) {
    const auto unit = metres_per_unit(modes[i].getPixelFormat());
    if (!text.empty()) text += ", ";
    text += fmt::format("{}x{} {} {} Hz", modes[i].getResolutionX(), modes[i].getResolutionY(),
                        !unit           ? "raw"
                        : *unit < 0.001 ? "0.1 mm"
                                        : "mm",
                        modes[i].getFps());
  }
  return text.empty() ? "none" : text;
}

std::optional<CameraModel> camera_from_fov(int width_px, int height_px, double horizontal_rad,
                                           double vertical_rad) noexcept {
  const auto angle = [](double rad) { return rad > 0.05 && rad < 3.0; };  // NaN fails
  if (width_px <= 0 || height_px <= 0 || !angle(horizontal_rad) || !angle(vertical_rad)) return {};
  return CameraModel{width_px,
                     height_px,
                     0.5 * width_px / std::tan(0.5 * horizontal_rad),
                     0.5 * height_px / std::tan(0.5 * vertical_rad),
                     0.5 * (width_px - 1),
                     0.5 * (height_px - 1)};
}

}  // namespace maplet::openni2
