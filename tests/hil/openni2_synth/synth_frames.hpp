// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <vector>

#include "core/ports/depth_source.hpp"
#include "drivers/sim/sim_source.hpp"
#include "tests/hil/openni2_synth/script.hpp"

namespace maplet::synth {

/// What the synthetic camera sees: the simulator's world, or a recording in TUM layout. Depth in
/// mm.
class Frames {
 public:
  struct Shown {
    DepthFrame frame;                   ///< on loan until the next one
    std::chrono::microseconds since{};  ///< the first one; a simulated one is stamped by the script
  };

  /// @param width_px  of the simulator's images; a recording has its own
  /// Without images after a problem, which it says on standard error.
  Frames(const Script& script, int width_px);
  [[nodiscard]] std::optional<Shown> next();
  /// The sizes that the camera offers.
  [[nodiscard]] static std::vector<ImageSize> sizes(const Script& script);
  [[nodiscard]] const CameraModel& camera() const { return camera_; }

 private:
  void open_world(const Script& script, int width_px);
  void open_recording(const Script& script);
  void to_millimetres(DepthFrame& frame);

  std::unique_ptr<DepthSource> source_;
  bool recorded_ = false;
  CameraModel camera_{320, 240, 285, 285, 160, 120};
  std::chrono::duration<double> period_;
  std::int64_t count_ = 0;
  std::optional<Stamp> first_;
  std::vector<std::uint16_t> millimetres_;
};

}  // namespace maplet::synth
