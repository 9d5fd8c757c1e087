// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenNI.h>

#include <array>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/ports/depth_source.hpp"
#include "drivers/line.hpp"
#include "drivers/openni2/demand_gate.hpp"
#include "drivers/openni2/pixels.hpp"
#include "drivers/openni2/runtime.hpp"
#include "drivers/source.hpp"

namespace maplet::openni2 {

/// Frames of one open device: see open_openni2().
class Capture final : public DepthSource {
 public:
  static constexpr Duration kGrayTolerance = std::chrono::milliseconds{20};

  /// @param uri  of a camera, or the absolute path of a recording
  Capture(std::string uri, bool recording, const SourceOptions& options);
  ~Capture() override;

  /// Opens and starts it; once. After an error the object is of no use.
  /// @param record_to  a file (.oni) that a camera's frames also go into, from the first on; empty
  /// =
  ///   none
  [[nodiscard]] tl::expected<void, SourceError> open(const std::string& record_to = {});

  [[nodiscard]] Expected<DepthFrame> next(Deadline deadline) noexcept override;
  [[nodiscard]] SourceCounters counters() const noexcept override { return counters_; }
  [[nodiscard]] std::string_view detail() const noexcept override { return view(detail_); }
  [[nodiscard]] std::optional<Instant> came() const noexcept override { return came_; }
  [[nodiscard]] std::optional<std::uint64_t> length() const noexcept override { return length_; }
  [[nodiscard]] std::optional<ImageSize> size() const noexcept override {
    return ImageSize{frame_.camera.width_px, frame_.camera.height_px};
  }

 private:
  using Setup = tl::expected<void, SourceError>;
  using Monotonic = std::chrono::steady_clock;

  /// Woken by a camera's frames.
  struct Bell {
    std::mutex mutex;
    std::condition_variable rung;
  };
  /// Called by the runtime, on its thread, for each frame of a camera's stream.
  struct Arrivals final : openni::VideoStream::NewFrameListener {
    explicit Arrivals(Bell& whose) : bell{whose} {}
    void onNewFrame(openni::VideoStream& stream) override;

    Bell& bell;  ///< its mutex guards what follows
    bool fresh = false;
    Instant last{};
  };
  /// A stream, and the gate that keeps a recording's frames in step.
  struct Channel {
    explicit Channel(Bell& bell) : arrivals{bell} {}

    Arrivals arrivals;                 ///< of a camera; outlives the stream
    std::unique_ptr<DemandGate> gate;  ///< outlives the stream
    openni::VideoStream stream;
    bool demanded = false;

    void demand() noexcept;
    [[nodiscard]] bool read(openni::VideoFrameRef& frame) noexcept;
  };
  struct GrayImage {
    std::vector<std::uint8_t> pixels;
    std::optional<Stamp> stamp;  ///< nothing: no image yet
  };
  enum class Got : std::uint8_t { kDepth, kColour, kNothing, kFailure };

  Setup open_depth();
  Setup set_depth_mode();
  Setup set_camera(int width_px, int height_px);
  Setup open_recording();
  void open_colour();
  Setup start_recorder(const std::string& file);
  Setup start(Channel& channel);
  void stop() noexcept;

  Got wait(bool depth_too, int timeout_ms) noexcept;
  Got wait_live(bool depth_too, int timeout_ms) noexcept;
  void take_depth() noexcept;
  void take_colour() noexcept;
  [[nodiscard]] bool gray_settled() noexcept;
  [[nodiscard]] Expected<DepthFrame> nothing_came(bool ended) noexcept;
  [[nodiscard]] DepthFrame deliver() noexcept;
  [[nodiscard]] tl::unexpected<SourceError> bad(std::string what) const;

  const std::string uri_;
  const bool recording_;
  const SourceOptions options_;
  DeviceEvents events_;
  openni::Device device_;
  Bell bell_;
  Channel depth_{bell_};
  Channel colour_{bell_};
  openni::Recorder recorder_;
  Instant came_{};
  Layout layout_{};
  bool gray_wanted_ = false;

  DepthFrame frame_;
  std::vector<std::uint16_t> pixels_;
  bool have_depth_ = false;
  Monotonic::time_point depth_came_{};
  Monotonic::time_point last_came_{};
  std::optional<Stamp> last_stamp_;
  std::optional<int> last_index_;
  std::uint64_t next_index_ = 0;
  std::array<GrayImage, 2> grays_;
  std::size_t newest_gray_ = 0;

  SourceCounters counters_;
  std::optional<std::uint64_t> length_;
  Line detail_;
};

}  // namespace maplet::openni2
