// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <tl/expected.hpp>

#include "core/base/field.hpp"

namespace maplet::sim {

/// The keys of `sim:WORLD?key=value&...`.
struct SimOptions {
  int seed = 1;
  int agent = 0;
  int frames = 0;
  int width = 640;
  double rate_hz = 30.0;
  double noise = 1.0;
  bool handa = false;
  bool dropout = true;
  bool gray = true;
  double texture = 1.0;
  double min_m = 0.5;
  double max_m = 8.0;
  double speed_m_per_s = 0.5;
  double yaw_rate_rad_per_s = 0.7;
  double wobble = 1.0;
  double phase = -1.0;
  bool reverse = false;
  double loop_m = 48.0;
  double length_m = 12.0;

  using Self = SimOptions;
  static constexpr Field<SimOptions> kFields[] = {
      {"seed", &Self::seed, 0, 2147483647, "World's furniture, texture, noise and start"},
      {"agent", &Self::agent, 0, 255, "Another robot in the same world: own start and own noise"},
      {"frames", &Self::frames, 0, 1000000, "How many frames; 0 = one round of the path"},
      {"width", &Self::width, 160, 640, "Image width: 640, 320 or 160 pixels, 4:3"},
      {"rate_hz", &Self::rate_hz, 1, 240, "Frames per second of the stamps"},
      {"noise", &Self::noise, 0, 10, "Scale of the depth noise; 0 = exact depth in whole mm"},
      {"handa", &Self::handa, 0, 1, "Noise as in ICL-NUIM instead of Khoshelham's"},
      {"dropout", &Self::dropout, 0, 1,
       "Missing depth at grazing angles, edges and shadows (only with noise)"},
      {"gray", &Self::gray, 0, 1, "Make the gray image"},
      {"texture", &Self::texture, 0, 1, "Contrast of the texture; 0 = plain shaded surfaces"},
      {"min_m", &Self::min_m, 0.05, 20, "Nearest depth that returns"},
      {"max_m", &Self::max_m, 0.1, 65, "Farthest depth that returns"},
      {"speed_m_per_s", &Self::speed_m_per_s, 0.05, 5, "Speed limit"},
      {"yaw_rate_rad_per_s", &Self::yaw_rate_rad_per_s, 0.05, 5, "Yaw rate limit"},
      {"wobble", &Self::wobble, 0, 3, "Scale of pitch, roll, yaw and height variation"},
      {"phase", &Self::phase, -1, 1, "Start on the path, 0..1 of a round; negative: by the seed"},
      {"reverse", &Self::reverse, 0, 1, "Go round the other way"},
      {"loop_m", &Self::loop_m, 40, 400, "Length of the loop world's centre line"},
      {"length_m", &Self::length_m, 2, 400, "Length of the corridor world's path, one way"},
  };
};

/// @return the options, or one line that says which key or value is wrong and what there is
[[nodiscard]] tl::expected<SimOptions, std::string> parse_options(
    const std::map<std::string, std::string>& parameters);

/// A line for each key: what it does and its default.
[[nodiscard]] std::string describe_options();

}  // namespace maplet::sim
