// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/sim/sim_source.hpp"

#include <fmt/format.h>

#include <cmath>

namespace maplet {
namespace {

/// PrimeSense's own figure for 640 x 480; smaller images are binned ones.
CameraModel kinect_class(int width_px) {
  const double scale = width_px / 640.0;
  const int height_px = width_px * 3 / 4;
  const double focal_px = 570.342 * scale;
  return {width_px, height_px, focal_px, focal_px, 0.5 * (width_px - 1), 0.5 * (height_px - 1)};
}

}  // namespace

SimSource::SimSource(sim::World world, const sim::SimOptions& options)
    : options_{options},
      world_{std::make_unique<const sim::World>(std::move(world))},
      camera_{kinect_class(options.width)},
      trajectory_{world_->route, options},
      raster_{*world_, camera_},
      sensor_{*world_, camera_, options},
      painter_{*world_, camera_, options},
      frames_{options.frames > 0
                  ? static_cast<std::uint64_t>(options.frames)
                  : static_cast<std::uint64_t>(std::ceil(trajectory_.round_s() * options.rate_hz)) +
                        1},
      depth_mm_(static_cast<std::size_t>(camera_.width_px * camera_.height_px)),
      labels_(depth_mm_.size()),
      gray_(options.gray ? depth_mm_.size() : 0) {}

Stamp SimSource::stamp(std::uint64_t index) const noexcept {
  const double us = static_cast<double>(index) * 1e6 / options_.rate_hz;
  return std::chrono::microseconds{static_cast<std::int64_t>(std::floor(us + 0.5))};
}

Transform<WorldFrame, CameraFrame> SimSource::pose(std::uint64_t index) const noexcept {
  return Transform<WorldFrame, CameraFrame>{trajectory_.at(seconds(stamp(index)))};
}

Expected<DepthFrame> SimSource::next(Deadline) noexcept {
  if (next_ >= frames_) return fail(ErrorCode::kEnd, "the simulated recording is over");
  const std::uint64_t index = next_++;
  T_world_camera_ = pose(index);
  raster_.draw(T_world_camera_.se3);
  sensor_.measure(raster_, index, depth_mm_.data(), labels_.data());
  ++counters_.read;

  DepthFrame frame;
  frame.index = index;
  frame.stamp = stamp(index);
  frame.depth = {depth_mm_.data(), camera_.width_px, camera_.height_px, camera_.width_px};
  frame.metres_per_unit = 0.001;
  frame.camera = camera_;
  frame.noise = noise_.value_or(sensor_.noise_model());
  if (options_.gray) {
    painter_.paint(raster_, T_world_camera_.se3, index, gray_.data());
    frame.gray = {gray_.data(), camera_.width_px, camera_.height_px, camera_.width_px};
  }
  return frame;
}

tl::expected<std::unique_ptr<SimSource>, std::string> open_sim(
    const std::string& world, const std::map<std::string, std::string>& parameters) {
  if (!sim::is_world(world)) {
    return tl::unexpected<std::string>{
        fmt::format("sim: no world '{}'; there are {}", world, sim::world_names())};
  }
  const auto options = sim::parse_options(parameters);
  if (!options) return tl::unexpected<std::string>{options.error()};
  return std::make_unique<SimSource>(sim::make_world(world, *options), *options);
}

}  // namespace maplet
