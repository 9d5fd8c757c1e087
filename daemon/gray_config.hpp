// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <string>

#include "core/base/field.hpp"
#include "core/limits.hpp"

namespace maplet::daemon {

/// A gray camera beside the depth camera. Section [gray_camera].
struct GrayConfig {
  std::string source;
  int width_px = 640;
  int height_px = 480;
  double fx_px = 0.0;
  double fy_px = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;
  std::string T_depth_gray = "0,0,0,0,0,0,1";
  double rate_hz = 30.0;
  Duration tolerance = std::chrono::milliseconds{20};
  Duration depth_delay{};
  Duration exposure{};
  Duration exposure_limit{};
  double gain = 1.0;

  [[nodiscard]] bool used() const noexcept { return !source.empty(); }

  static constexpr Field<GrayConfig> kFields[] = {
      {"source", &GrayConfig::source, 0, 0,
       "libcamera: (the first camera) or libcamera:ID; empty = none. Goes before a gray image of "
       "the depth camera's own"},
      {"width_px", &GrayConfig::width_px, 16, kMaxWidthPx, "Image width"},
      {"height_px", &GrayConfig::height_px, 16, kMaxHeightPx, "Image height"},
      {"fx_px", &GrayConfig::fx_px, -1e5, 1e5, "Focal length in x"},
      {"fy_px", &GrayConfig::fy_px, -1e5, 1e5, "Focal length in y"},
      {"cx_px", &GrayConfig::cx_px, -1e5, 1e5, "Principal point in x"},
      {"cy_px", &GrayConfig::cy_px, -1e5, 1e5, "Principal point in y"},
      {"T_depth_gray", &GrayConfig::T_depth_gray, 0, 0,
       "Pose of the gray camera in the depth camera's frame: x,y,z,qx,qy,qz,qw in m"},
      {"rate_hz", &GrayConfig::rate_hz, 1.0, 240.0, "Images a second"},
      {"tolerance_ms", &GrayConfig::tolerance, 0, 1000,
       "Between the stamps of a depth frame and its image, at most"},
      {"depth_delay_ms", &GrayConfig::depth_delay, -1000, 1000,
       "From a depth frame's exposure until it is here, minus the same of the gray camera's stamp"},
      {"exposure_us", &GrayConfig::exposure, 0, 1e6, "Fixed exposure; 0 = automatic"},
      {"exposure_limit_us", &GrayConfig::exposure_limit, 0, 1e6,
       "Of the automatic exposure: images then come so often; 0 = as rate_hz lets it"},
      {"gain", &GrayConfig::gain, 1.0, 64.0, "With a fixed exposure"},
  };
};

}  // namespace maplet::daemon
