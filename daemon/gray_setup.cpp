// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/gray_setup.hpp"

#include <string_view>

#include "daemon/pose_text.hpp"

namespace maplet::daemon {

tl::expected<GrayCameraOptions, std::string> gray_options(const GrayConfig& config) {
  GrayCameraOptions options;
  if (!config.used()) return options;
  constexpr std::string_view kScheme = "libcamera:";
  const auto wrong = [](std::string_view what) {
    return tl::unexpected{"gray_camera." + std::string{what}};
  };
  if (!config.source.starts_with(kScheme)) {
    return wrong("source = '" + config.source + "': must be libcamera: or libcamera:ID");
  }
  options.id = config.source.substr(kScheme.size());
  options.camera = {config.width_px, config.height_px, config.fx_px,
                    config.fy_px,    config.cx_px,     config.cy_px};
  if (!options.camera.valid()) {
    return wrong("fx_px, fy_px, cx_px and cy_px are needed: calibrate the camera");
  }
  const auto pose = pose_of(config.T_depth_gray);
  if (!pose) {
    return wrong("T_depth_gray = '" + config.T_depth_gray +
                 "': must be x,y,z,qx,qy,qz,qw with a quaternion of length 1");
  }
  options.T_depth_gray = *pose;
  options.rate_hz = config.rate_hz;
  options.tolerance = config.tolerance;
  options.depth_delay = config.depth_delay;
  options.exposure = config.exposure;
  options.exposure_limit = config.exposure_limit;
  options.gain = config.gain;
  return options;
}

}  // namespace maplet::daemon
