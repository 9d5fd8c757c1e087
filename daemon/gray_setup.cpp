// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/gray_setup.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

namespace maplet::daemon {

namespace {

/// x,y,z,qx,qy,qz,qw
std::optional<Se3> pose_of(std::string_view text) {
  std::array<double, 7> n{};
  for (std::size_t i = 0; i < n.size(); ++i) {
    while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), n[i]);
    if (error != std::errc{} || !std::isfinite(n[i])) return {};
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    const bool last = i + 1 == n.size();
    if (last != text.empty() || (!last && text.front() != ',')) return {};
    if (!last) text.remove_prefix(1);
  }
  Se3 pose;
  pose.t = {n[0], n[1], n[2]};
  pose.q = {n[6], n[3], n[4], n[5]};
  if (std::abs(pose.q.norm() - 1.0) > 0.01) return {};
  pose.q.normalize();
  return pose;
}

}  // namespace

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
