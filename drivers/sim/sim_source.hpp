// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/ports/depth_source.hpp"
#include "drivers/sim/options.hpp"
#include "drivers/sim/raster.hpp"
#include "drivers/sim/sensor.hpp"
#include "drivers/sim/texture.hpp"
#include "drivers/sim/trajectory.hpp"
#include "drivers/sim/world.hpp"

namespace maplet {

/// A depth camera in a made-up building: exact truth, published noise, any frame again at will.
///
/// Frame i depends on the options and i alone, so the same URI makes the same bytes.
///
/// Memory   all buffers made by the constructor; next() allocates nothing.
/// Time     5 to 10 ms a frame of 640 x 480.
/// Threads  one caller at a time.
/// Math     docs/simulator.md; the sensor in drivers/sim/sensor.hpp.
class SimSource final : public DepthSource {
 public:
  SimSource(sim::World world, const sim::SimOptions& options);

  [[nodiscard]] Expected<DepthFrame> next(Deadline deadline) noexcept override;
  [[nodiscard]] SourceCounters counters() const noexcept override { return counters_; }
  [[nodiscard]] std::optional<std::uint64_t> length() const noexcept override { return frames_; }
  [[nodiscard]] std::optional<ImageSize> size() const noexcept override {
    return ImageSize{camera_.width_px, camera_.height_px};
  }

  /// The next call of next() makes frame `index`.
  void seek(std::uint64_t index) noexcept { next_ = index; }

  /// What frames say of their noise, whatever it is.
  void say_noise(const NoiseModel& noise) noexcept { noise_ = noise; }

  // The truth. What speaks of "the frame" means the last one that next() made.

  /// The camera's pose in the world's frame (z up, floor at 0).
  [[nodiscard]] const Transform<WorldFrame, CameraFrame>& T_world_camera() const noexcept {
    return T_world_camera_;
  }
  [[nodiscard]] Transform<WorldFrame, CameraFrame> pose(std::uint64_t index) const noexcept;
  [[nodiscard]] Stamp stamp(std::uint64_t index) const noexcept;
  /// Id of the plane that each pixel's depth was read from, row-major; 0 where there is no depth.
  [[nodiscard]] std::span<const std::uint16_t> labels() const noexcept { return labels_; }
  /// The world's planes: id - 1 is the index; world frame, n on the side that is seen.
  [[nodiscard]] std::span<const Plane> planes() const noexcept { return world_->planes; }
  /// Exact inverse depth of every pixel, 1/m; 0 = nothing there.
  [[nodiscard]] const float* exact_inverse_depth() const noexcept {
    return raster_.inverse_depth();
  }

  [[nodiscard]] const CameraModel& camera() const noexcept { return camera_; }
  [[nodiscard]] const sim::SimOptions& options() const noexcept { return options_; }
  [[nodiscard]] const sim::World& world() const noexcept { return *world_; }
  [[nodiscard]] const sim::Trajectory& trajectory() const noexcept { return trajectory_; }

 private:
  sim::SimOptions options_;
  std::unique_ptr<const sim::World> world_;  ///< others point to it
  CameraModel camera_;
  sim::Trajectory trajectory_;
  sim::Raster raster_;
  sim::Sensor sensor_;
  sim::Painter painter_;
  std::uint64_t frames_;
  std::uint64_t next_ = 0;
  SourceCounters counters_;
  std::optional<NoiseModel> noise_;
  Transform<WorldFrame, CameraFrame> T_world_camera_;
  std::vector<std::uint16_t> depth_mm_;
  std::vector<std::uint16_t> labels_;
  std::vector<std::uint8_t> gray_;
};

/// Opens `sim:WORLD?key=value&...`.
/// @return the source, or one line that says what is wrong and what there is
[[nodiscard]] tl::expected<std::unique_ptr<SimSource>, std::string> open_sim(
    const std::string& world, const std::map<std::string, std::string>& parameters);

}  // namespace maplet
