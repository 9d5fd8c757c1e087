// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/libcamera/gray_stream.hpp"

#include <fmt/format.h>
#include <libcamera/control_ids.h>
#include <libcamera/request.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>

namespace maplet::camera {

namespace {

using Problem = tl::unexpected<std::string>;
namespace controls_of = libcamera::controls;

constexpr unsigned kBuffers = 4;

std::int64_t microseconds(Duration time) { return time / std::chrono::microseconds{1}; }

}  // namespace

GrayStream::GrayStream(std::shared_ptr<libcamera::Camera> camera, GrayRing& ring,
                       const GrayCameraOptions& options)
    : camera_{std::move(camera)}, ring_{ring}, options_{options} {}

GrayStream::~GrayStream() {
  if (started_) camera_->stop();
  camera_->requestCompleted.disconnect();
  camera_->disconnected.disconnect();
  requests_.clear();
  for (const Mapping& mapping : mappings_) munmap(mapping.memory, mapping.bytes);
  buffers_.reset();
  if (acquired_) camera_->release();
}

tl::expected<std::string, std::string> GrayStream::open() {
  if (const int error = camera_->acquire(); error != 0) {
    return Problem{
        fmt::format("{}: {}; is another program using it?", camera_->id(), std::strerror(-error))};
  }
  acquired_ = true;
  if (auto done = configure(); !done) return Problem{done.error()};
  if (auto done = map_buffers(); !done) return Problem{done.error()};
  camera_->disconnected.connect(this, &GrayStream::lost);
  camera_->requestCompleted.connect(this, &GrayStream::completed);
  std::string said;
  libcamera::ControlList wishes = controls(said);
  if (const int error = camera_->start(&wishes); error != 0) {
    return Problem{fmt::format("{}: does not start: {}", camera_->id(), std::strerror(-error))};
  }
  started_ = true;
  if (auto done = queue_all(); !done) return Problem{done.error()};
  return fmt::format("{}: {}{}", camera_->id(), configuration_->at(0).toString(), said);
}

auto GrayStream::configure() -> Done {
  configuration_ = camera_->generateConfiguration({libcamera::StreamRole::Viewfinder});
  if (!configuration_ || configuration_->empty()) {
    return Problem{camera_->id() + ": offers no stream"};
  }
  libcamera::StreamConfiguration& stream = configuration_->at(0);
  // The first format with a luma plane; planes before packed ones.
  const auto formats = stream.formats().pixelformats();
  const libcamera::PixelFormat* chosen = nullptr;
  for (const auto& format : formats) {
    const auto layout = luma_layout(format.fourcc());
    if (!layout || format.modifier() != 0) continue;
    if (chosen == nullptr || layout->step < luma_layout(chosen->fourcc())->step) chosen = &format;
  }
  if (chosen != nullptr) stream.pixelFormat = *chosen;
  stream.size = {static_cast<unsigned>(options_.camera.width_px),
                 static_cast<unsigned>(options_.camera.height_px)};
  stream.bufferCount = kBuffers;
  if (configuration_->validate() == libcamera::CameraConfiguration::Invalid) {
    return Problem{camera_->id() + ": takes no configuration"};
  }
  const auto layout = luma_layout(stream.pixelFormat.fourcc());
  if (!layout) {
    return Problem{fmt::format("{}: gives {}, which has no luma plane: another camera is needed",
                               camera_->id(), stream.pixelFormat.toString())};
  }
  if (stream.size.width != static_cast<unsigned>(options_.camera.width_px) ||
      stream.size.height != static_cast<unsigned>(options_.camera.height_px)) {
    return Problem{fmt::format("{}: gives {}, the configuration's gray camera is {}x{}: correct it",
                               camera_->id(), stream.size.toString(), options_.camera.width_px,
                               options_.camera.height_px)};
  }
  layout_ = *layout;
  if (const int error = camera_->configure(configuration_.get()); error != 0) {
    return Problem{fmt::format("{}: is not configured: {}", camera_->id(), std::strerror(-error))};
  }
  stride_bytes_ = stream.stride;
  return {};
}

auto GrayStream::map_buffers() -> Done {
  libcamera::Stream* stream = configuration_->at(0).stream();
  buffers_ = std::make_unique<libcamera::FrameBufferAllocator>(camera_);
  if (buffers_->allocate(stream) < 0) return Problem{camera_->id() + ": gives no buffers"};
  for (const auto& buffer : buffers_->buffers(stream)) {
    const libcamera::FrameBuffer::Plane& plane = buffer->planes().front();
    const std::size_t offset =
        plane.offset == libcamera::FrameBuffer::Plane::kInvalidOffset ? 0 : plane.offset;
    const std::size_t bytes = offset + plane.length;
    void* memory = mmap(nullptr, bytes, PROT_READ, MAP_SHARED, plane.fd.get(), 0);
    if (memory == MAP_FAILED) return Problem{camera_->id() + ": its buffers cannot be mapped"};
    mappings_.push_back({memory, bytes});
    planes_[buffer.get()] = {static_cast<const std::uint8_t*>(memory) + offset, plane.length};
  }
  return {};
}

auto GrayStream::queue_all() -> Done {
  libcamera::Stream* stream = configuration_->at(0).stream();
  for (const auto& buffer : buffers_->buffers(stream)) {
    auto request = camera_->createRequest();
    if (!request || request->addBuffer(stream, buffer.get()) != 0) {
      return Problem{camera_->id() + ": takes no requests"};
    }
    requests_.push_back(std::move(request));
  }
  for (const auto& request : requests_) {
    if (camera_->queueRequest(request.get()) != 0) {
      return Problem{camera_->id() + ": takes no requests"};
    }
  }
  return {};
}

/// @param said  what the camera cannot be told
libcamera::ControlList GrayStream::controls(std::string& said) const {
  const libcamera::ControlInfoMap& known = camera_->controls();
  const auto knows = [&](const libcamera::ControlId& control, const char* name) {
    const bool yes = known.find(control.id()) != known.end();
    if (!yes) said += fmt::format(", has no {}", name);
    return yes;
  };
  libcamera::ControlList wishes{known};
  Duration frame{static_cast<std::int64_t>(1e9 / options_.rate_hz)};
  if (options_.exposure_limit > Duration{0}) frame = std::min(frame, options_.exposure_limit);
  if (knows(controls_of::FrameDurationLimits, "rate control")) {
    const std::array<std::int64_t, 2> limits{microseconds(frame), microseconds(frame)};
    wishes.set(controls_of::FrameDurationLimits,
               libcamera::Span<const std::int64_t, 2>{limits.data(), 2});
  }
  if (options_.exposure == Duration{0}) return wishes;
  if (knows(controls_of::AeEnable, "automatic exposure to switch off")) {
    wishes.set(controls_of::AeEnable, false);
  }
  if (knows(controls_of::ExposureTime, "exposure time")) {
    const libcamera::ControlInfo& range = known.find(controls_of::ExposureTime.id())->second;
    const auto wanted = static_cast<std::int32_t>(microseconds(options_.exposure));
    const auto least = range.min().get<std::int32_t>();
    const auto most = std::max(least, range.max().get<std::int32_t>());
    wishes.set(controls_of::ExposureTime, std::clamp(wanted, least, most));
  }
  if (knows(controls_of::AnalogueGain, "gain")) {
    wishes.set(controls_of::AnalogueGain, static_cast<float>(options_.gain));
  }
  return wishes;
}

void GrayStream::completed(libcamera::Request* request) {
  if (request->status() == libcamera::Request::RequestCancelled) return;
  const libcamera::FrameBuffer* buffer = request->buffers().begin()->second;
  const libcamera::FrameMetadata& metadata = buffer->metadata();
  const LumaImage image{planes_.at(buffer), stride_bytes_, options_.camera.width_px,
                        options_.camera.height_px};
  if (metadata.status == libcamera::FrameMetadata::FrameSuccess &&
      copy_luma(image, layout_, ring_.room())) {
    ring_.put(Instant{Duration{static_cast<std::int64_t>(metadata.timestamp)}});
  } else {
    ++damaged_;
  }
  request->reuse(libcamera::Request::ReuseBuffers);
  if (camera_->queueRequest(request) != 0) gone_ = true;
}

}  // namespace maplet::camera
