// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/run_setup.hpp"

#include <fmt/format.h>

#include <random>
#include <span>
#include <string>

#include "core/base/crc.hpp"
#include "core/frame/sensor_kind.hpp"
#include "daemon/config_io.hpp"
#include "drivers/content_mark.hpp"

namespace maplet::daemon {

namespace {

bool is_recording(std::string_view uri) {
  return !uri.starts_with("openni2:") || uri.find(".oni") != std::string_view::npos;
}

/// What the configuration leaves at 0 is that of a typical sensor of the kind.
NoiseModel noise_model(const CameraConfig& c) {
  NoiseModel model = typical_noise(*sensor_kind(c.noise));
  if (c.disparity_k > 0.0) model.disparity_k = c.disparity_k;
  if (c.tof_floor_m > 0.0) model.tof_floor_m = c.tof_floor_m;
  if (c.tof_slope > 0.0) model.tof_slope = c.tof_slope;
  if (c.correlated_px > 0.0) model.correlated_px = c.correlated_px;
  return model;
}

}  // namespace

Pace pace_of(const Options& options, const Config& config) {
  if (!is_recording(config.input.source)) return Pace::kLive;
  return options.pace == Options::Pace::kFast ? Pace::kFast : Pace::kRecorded;
}

std::uint32_t epoch_of(const Options& options, const Config& config, const StateDirectory& state) {
  const bool goes_on = state.holds_mission() && state.mode() == StateDirectory::Mode::kJournal;
  if (goes_on) return state.survey().life.epoch;
  // Whoever keeps missions may have had others, of which nothing is left here.
  const bool keeps = state.mode() != StateDirectory::Mode::kNone;
  if (keeps || pace_of(options, config) != Pace::kFast) return std::random_device{}();
  Config content = config;  // without where the source lies and where the records go
  content.input.source.clear();
  content.dds = {};
  content.ros2 = {};
  content.autopilot = {};
  const std::string all = fmt::format("{}\n{}\n{:08x}\n{}", MAPLET_VERSION, options.agent,
                                      content_mark(config.input.source), print_config(content));
  return crc32c(std::as_bytes(std::span{all}));
}

SourceOptions source_options(const Config& config) {
  const CameraConfig& c = config.camera;
  SourceOptions options;
  options.camera = {c.width_px, c.height_px, c.fx_px, c.fy_px, c.cx_px, c.cy_px};
  options.metres_per_unit = c.metres_per_unit;
  options.registered_to_colour = c.registered_to_colour;
  options.gray = config.input.gray == "auto" && !config.gray.used();
  options.noise = noise_model(c);
  options.noise_given =
      c.disparity_k > 0.0 || c.tof_floor_m > 0.0 || c.tof_slope > 0.0 || c.correlated_px > 0.0;
  return options;
}

}  // namespace maplet::daemon
