// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Opening a device: what is chosen, and what can be wrong with it.
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <thread>

#include "core/limits.hpp"
#include "drivers/openni2/capture.hpp"
#include "drivers/openni2/video_mode.hpp"

namespace maplet::openni2 {

namespace {

using Kind = SourceError::Kind;

constexpr float kFrameByFrame = -1.0F;
constexpr auto kPlayerSettles = std::chrono::milliseconds{25};

}  // namespace

Capture::Capture(std::string uri, bool recording, const SourceOptions& options)
    : uri_{std::move(uri)}, recording_{recording}, options_{options}, events_{uri_} {
  frame_.noise = options.noise;
}

Capture::~Capture() {
  recorder_.destroy();  // it closes the file
  stop();
  // The player looks through its streams without a lock: in a busy loop once a recording has ended,
  // every 10 ms when all are stopped. Streams are destroyed while it sleeps.
  if (recording_) std::this_thread::sleep_for(kPlayerSettles);
  colour_.stream.destroy();
  depth_.stream.destroy();
  device_.close();
}

void Capture::stop() noexcept {
  // The player may stand at a gate while it holds locks that stopping takes.
  for (Channel* channel : {&depth_, &colour_}) {
    if (channel->gate) channel->gate->open();
  }
  for (Channel* channel : {&colour_, &depth_}) {
    if (!channel->stream.isValid()) continue;
    channel->stream.removeNewFrameListener(&channel->arrivals);
    channel->stream.stop();
  }
}

tl::unexpected<SourceError> Capture::bad(std::string what) const {
  return source_error(Kind::kBad, fmt::format("openni2: {}: {}", uri_, what));
}

auto Capture::open(const std::string& record_to) -> Setup {
  if (device_.open(uri_.c_str()) != openni::STATUS_OK) {
    if (recording_) {
      return bad("OpenNI2 cannot play it: empty, cut off or not a recording (" + last_error() +
                 "); record it again");
    }
    return source_error(Kind::kAbsent,
                        fmt::format("openni2: {}: does not open: {}; is another program using it, "
                                    "may this user open it (udev rules)?",
                                    uri_, last_error()));
  }
  if (auto opened = open_depth(); !opened) return opened;
  if (recording_) {
    if (auto set = open_recording(); !set) return set;
  }
  open_colour();
  if (!record_to.empty()) {
    if (auto recorded = start_recorder(record_to); !recorded) return recorded;
  }
  if (auto started = start(depth_); !started) return started;
  // Depth does without gray: a colour stream that does not start is left out.
  if (gray_wanted_ && !start(colour_)) gray_wanted_ = false;
  last_came_ = Monotonic::now();
  return {};
}

auto Capture::open_depth() -> Setup {
  if (!device_.hasSensor(openni::SENSOR_DEPTH)) {
    return bad(recording_ ? "holds no depth stream: record one with depth"
                          : "has no depth sensor: choose another device");
  }
  if (depth_.stream.create(device_, openni::SENSOR_DEPTH) != openni::STATUS_OK) {
    return bad("no depth stream: " + last_error());
  }
  if (!recording_) {
    if (auto set = set_depth_mode(); !set) return set;
    depth_.stream.resetCropping();
    depth_.stream.setMirroringEnabled(false);
  }
  const openni::VideoMode mode = depth_.stream.getVideoMode();
  const auto unit = metres_per_unit(mode.getPixelFormat());
  if (!unit) {
    return bad(fmt::format("depth comes in pixel format {}: only millimetres and 0.1 mm are read",
                           static_cast<int>(mode.getPixelFormat())));
  }
  frame_.metres_per_unit = *unit;
  if (auto set = set_camera(mode.getResolutionX(), mode.getResolutionY()); !set) return set;
  layout_ = {frame_.camera.width_px, frame_.camera.height_px, depth_.stream.getMirroringEnabled()};
  pixels_.resize(static_cast<std::size_t>(layout_.width_px) *
                 static_cast<std::size_t>(layout_.height_px));
  return {};
}

auto Capture::set_depth_mode() -> Setup {
  const openni::SensorInfo& sensor = depth_.stream.getSensorInfo();
  const CameraModel wanted = options_.camera.valid() ? options_.camera : CameraModel{};
  const auto mode = choose_depth_mode(sensor, wanted);
  if (!mode && wanted.width_px == 0) {
    return bad("no depth mode that can be read at a rate above 0 Hz; there are " +
               list_modes(sensor));
  }
  if (!mode) {
    return bad(
        fmt::format("no depth mode of the configured size {}x{} at a rate above 0 Hz; there "
                    "are {}",
                    wanted.width_px, wanted.height_px, list_modes(sensor)));
  }
  if (depth_.stream.setVideoMode(*mode) != openni::STATUS_OK) {
    return bad("refuses its own depth mode: " + last_error());
  }
  return {};
}

auto Capture::set_camera(int width_px, int height_px) -> Setup {
  if (width_px <= 0 || height_px <= 0 || width_px > static_cast<int>(kMaxWidthPx) ||
      height_px > static_cast<int>(kMaxHeightPx)) {
    return bad(fmt::format("depth is {}x{}, at most {}x{} are supported", width_px, height_px,
                           kMaxWidthPx, kMaxHeightPx));
  }
  if (options_.camera.valid()) {
    frame_.camera = options_.camera;
    if (frame_.camera.width_px == width_px && frame_.camera.height_px == height_px) return {};
    return bad(fmt::format("depth is {}x{}, the configuration's camera {}x{}: correct it", width_px,
                           height_px, frame_.camera.width_px, frame_.camera.height_px));
  }
  const auto nominal = camera_from_fov(
      width_px, height_px, static_cast<double>(depth_.stream.getHorizontalFieldOfView()),
      static_cast<double>(depth_.stream.getVerticalFieldOfView()));
  if (!nominal) {
    return bad(
        "does not say its field of view: set camera.width_px height_px fx_px fy_px cx_px "
        "cy_px");
  }
  frame_.camera = *nominal;
  return {};
}

auto Capture::open_recording() -> Setup {
  openni::PlaybackControl* playback = device_.getPlaybackControl();
  if (playback == nullptr) return bad("is no recording");
  const int frames = playback->getNumberOfFrames(depth_.stream);
  if (frames <= 0) {
    return bad("holds no depth frames: empty, or cut off before it was closed; record it again");
  }
  length_ = static_cast<std::uint64_t>(frames);
  if (playback->setRepeatEnabled(false) != openni::STATUS_OK ||
      playback->setSpeed(kFrameByFrame) != openni::STATUS_OK) {
    return bad("does not play frame by frame: " + last_error());
  }
  return {};
}

void Capture::open_colour() {
  if (!options_.gray || !device_.hasSensor(openni::SENSOR_COLOR)) return;
  const auto mode = choose_colour_mode(*device_.getSensorInfo(openni::SENSOR_COLOR),
                                       depth_.stream.getVideoMode());
  if (!mode) return;
  constexpr auto kRegistered = openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR;
  const bool registered =
      recording_ ? options_.registered_to_colour
                 : device_.isImageRegistrationModeSupported(kRegistered) &&
                       device_.setImageRegistrationMode(kRegistered) == openni::STATUS_OK;
  if (!registered) return;
  if (colour_.stream.create(device_, openni::SENSOR_COLOR) != openni::STATUS_OK) return;
  if (!recording_) {
    if (colour_.stream.setVideoMode(*mode) != openni::STATUS_OK) return;
    colour_.stream.resetCropping();
    colour_.stream.setMirroringEnabled(false);
  }
  for (GrayImage& gray : grays_) gray.pixels.resize(pixels_.size());
  gray_wanted_ = true;
}

auto Capture::start_recorder(const std::string& file) -> Setup {
  const auto failed = [&] {
    return bad(fmt::format("cannot be recorded to {}: {}; make room, or name another file", file,
                           last_error()));
  };
  // OpenNI2's recorder does not come back from a file that it cannot make.
  const int made = ::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (made < 0) {
    return bad(fmt::format("cannot be recorded to {}: {}; name a file that may be written", file,
                           std::strerror(errno)));
  }
  ::close(made);
  if (recorder_.create(file.c_str()) != openni::STATUS_OK) return failed();
  for (Channel* channel : {&depth_, &colour_}) {
    if (channel->stream.isValid() && recorder_.attach(channel->stream) != openni::STATUS_OK) {
      return failed();
    }
  }
  if (recorder_.start() != openni::STATUS_OK) return failed();
  return {};
}

auto Capture::start(Channel& channel) -> Setup {
  if (!recording_) channel.stream.addNewFrameListener(&channel.arrivals);
  const openni::VideoMode mode = channel.stream.getVideoMode();
  const std::size_t bytes = mode.getPixelFormat() == openni::PIXEL_FORMAT_RGB888 ? 3 : 2;
  channel.gate = std::make_unique<DemandGate>(bytes * pixels_.size(),
                                              recording_ ? DemandGate::kPlayed : DemandGate::kLive);
  if (!recording_) channel.gate->open();
  if (channel.stream.setFrameBuffersAllocator(channel.gate.get()) != openni::STATUS_OK) {
    return bad("takes no buffers of ours: " + last_error());
  }
  if (channel.stream.start() != openni::STATUS_OK) {
    return bad("does not start: " + last_error());
  }
  return {};
}

}  // namespace maplet::openni2
