// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tests/hil/openni2_synth/synth_frames.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

#include "drivers/replay/tum_source.hpp"

namespace maplet::synth {

Frames::Frames(const Script& script, int width_px) : period_{1.0 / script.rate_hz} {
  if (script.recording.empty()) {
    open_world(script, width_px);
  } else {
    open_recording(script);
  }
}

void Frames::open_world(const Script& script, int width_px) {
  auto parameters = script.parameters;
  parameters["width"] = std::to_string(width_px);
  auto world = open_sim(script.world, parameters);
  if (!world) {
    std::fprintf(stderr, "MAPLET_SYNTH: %s\n", world.error().c_str());
    return;
  }
  camera_ = (*world)->camera();
  source_ = std::move(*world);
}

void Frames::open_recording(const Script& script) {
  auto opened = TumSource::open(script.recording, {}, {});
  if (!opened) {
    std::fprintf(stderr, "MAPLET_SYNTH: %s\n", opened.error().what.c_str());
    return;
  }
  source_ = std::move(*opened);
  recorded_ = true;
  const ImageSize size = *source_->size();
  camera_.width_px = size.width_px;
  camera_.height_px = size.height_px;
  millimetres_.resize(size.pixels());
}

std::vector<ImageSize> Frames::sizes(const Script& script) {
  if (script.recording.empty()) return {{320, 240}, {640, 480}};
  const CameraModel camera = Frames{script, 0}.camera();
  return {{camera.width_px, camera.height_px}};
}

void Frames::to_millimetres(DepthFrame& frame) {
  const double scale = frame.metres_per_unit * 1000.0;
  std::size_t i = 0;
  for (int v = 0; v < frame.depth.height_px; ++v) {
    for (int u = 0; u < frame.depth.width_px; ++u) {
      const double mm = std::round(scale * frame.depth.at(u, v));
      constexpr double kMost = std::numeric_limits<std::uint16_t>::max();
      millimetres_[i++] = static_cast<std::uint16_t>(mm > kMost ? 0.0 : mm);
    }
  }
  frame.depth = {millimetres_.data(), frame.depth.width_px, frame.depth.height_px,
                 frame.depth.width_px};
}

std::optional<Frames::Shown> Frames::next() {
  using std::chrono::microseconds;
  if (!source_) return {};
  auto frame = source_->next(Deadline::never());
  if (!frame) return {};
  Shown shown{*frame, std::chrono::duration_cast<microseconds>(
                          std::chrono::duration_cast<std::chrono::nanoseconds>(count_ * period_))};
  ++count_;
  if (!recorded_) return shown;
  if (!first_) first_ = frame->stamp;
  shown.since = std::chrono::duration_cast<microseconds>(frame->stamp - *first_);
  to_millimetres(shown.frame);
  return shown;
}

}  // namespace maplet::synth
