// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/openni2/capture.hpp"

#include <algorithm>

namespace maplet::openni2 {

namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kSliceMs = 20;                 ///< between two looks at the deadline
constexpr auto kLiveWait = seconds{1};       ///< of one call without a frame
constexpr auto kLiveSilence = seconds{5};    ///< a camera that sends nothing for so long is broken
constexpr auto kPlayerSilence = seconds{5};  ///< a player that does is lost in a damaged file
constexpr auto kLiveGrayWait = milliseconds{15};

/// OpenNI2 counts microseconds.
Stamp stamp_of(const openni::VideoFrameRef& frame) noexcept {
  return std::chrono::microseconds{static_cast<std::int64_t>(frame.getTimestamp())};
}

}  // namespace

void Capture::Channel::demand() noexcept {
  if (!gate || demanded) return;
  demanded = true;
  gate->demand();
}

bool Capture::Channel::read(openni::VideoFrameRef& frame) noexcept {
  demanded = false;
  return stream.readFrame(&frame) == openni::STATUS_OK && frame.isValid();
}

void Capture::Arrivals::onNewFrame(openni::VideoStream& /*stream*/) {
  const std::scoped_lock lock{bell.mutex};
  last = MonotonicClock{}.now();
  fresh = true;
  bell.rung.notify_one();
}

// A camera's frames wake us by a bell of ours: OpenNI2's own wait allocates each time it looks.
auto Capture::wait_live(bool depth_too, int timeout_ms) noexcept -> Got {
  Channel* chosen = nullptr;
  {
    std::unique_lock lock{bell_.mutex};
    const auto fresh = [&] {
      return (depth_too && depth_.arrivals.fresh) || (gray_wanted_ && colour_.arrivals.fresh);
    };
    if (!bell_.rung.wait_for(lock, milliseconds{timeout_ms}, fresh)) return Got::kNothing;
    chosen = depth_too && depth_.arrivals.fresh ? &depth_ : &colour_;
    chosen->arrivals.fresh = false;
  }
  // Reading blocks when there is nothing: the frame may have been read with the one before.
  int ready = 0;
  openni::VideoStream* stream = &chosen->stream;
  const auto status = openni::OpenNI::waitForAnyStream(&stream, 1, &ready, 0);
  if (status == openni::STATUS_TIME_OUT) return Got::kNothing;
  if (status != openni::STATUS_OK) return Got::kFailure;
  return chosen == &depth_ ? Got::kDepth : Got::kColour;
}

auto Capture::wait(bool depth_too, int timeout_ms) noexcept -> Got {
  if (!recording_) return wait_live(depth_too, timeout_ms);
  std::array<openni::VideoStream*, 2> streams{};
  int count = 0;
  if (depth_too) {
    depth_.demand();
    streams[static_cast<std::size_t>(count++)] = &depth_.stream;
  }
  if (gray_wanted_) {
    colour_.demand();
    streams[static_cast<std::size_t>(count++)] = &colour_.stream;
  }
  int ready = 0;
  const auto status = openni::OpenNI::waitForAnyStream(streams.data(), count, &ready, timeout_ms);
  if (status == openni::STATUS_TIME_OUT) return Got::kNothing;
  if (status != openni::STATUS_OK) return Got::kFailure;
  return streams[static_cast<std::size_t>(ready)] == &depth_.stream ? Got::kDepth : Got::kColour;
}

void Capture::take_depth() noexcept {
  openni::VideoFrameRef frame;
  if (!depth_.read(frame)) return;
  last_came_ = depth_came_ = Monotonic::now();
  {
    const std::scoped_lock lock{bell_.mutex};
    came_ = depth_.arrivals.last;
  }
  if (!recording_ && last_index_ && frame.getFrameIndex() > *last_index_ + 1) {
    const auto lost = static_cast<std::uint64_t>(frame.getFrameIndex() - *last_index_ - 1);
    counters_.dropped += lost;
    next_index_ += lost;
  }
  last_index_ = frame.getFrameIndex();
  frame_.index = next_index_++;
  const Stamp stamp = stamp_of(frame);
  if (last_stamp_ && stamp <= *last_stamp_) {
    ++counters_.out_of_order;
    detail_ = line("openni2: {}: frame {}: stamp does not go forward", uri_, frame_.index);
    return;
  }
  if (!copy_depth(frame, layout_, options_.invalid_values, pixels_)) {
    ++counters_.unreadable;
    detail_ = line("openni2: {}: frame {} is {}x{} in {} bytes, expected {}x{}", uri_, frame_.index,
                   frame.getWidth(), frame.getHeight(), frame.getDataSize(), layout_.width_px,
                   layout_.height_px);
    return;
  }
  frame_.stamp = stamp;
  last_stamp_ = stamp;
  have_depth_ = true;
}

void Capture::take_colour() noexcept {
  openni::VideoFrameRef frame;
  if (!colour_.read(frame)) return;
  const std::size_t older = 1 - newest_gray_;
  Layout layout = layout_;
  layout.mirrored = colour_.stream.getMirroringEnabled();
  if (!copy_gray(frame, layout, grays_[older].pixels)) {
    ++counters_.unreadable;
    detail_ = line("openni2: {}: colour frame is {}x{}, expected {}x{}", uri_, frame.getWidth(),
                   frame.getHeight(), layout_.width_px, layout_.height_px);
    return;
  }
  grays_[older].stamp = stamp_of(frame);
  newest_gray_ = older;
}

/// Gray is settled when none that comes later can be nearer in time to the depth image. In a
/// recording the next depth image at its gate says so too: this depends on the file alone, so a
/// replay pairs the same images every time.
bool Capture::gray_settled() noexcept {
  if (!gray_wanted_) return true;
  const auto newest = [&] { return grays_[newest_gray_].stamp; };
  if (newest() && *newest() >= frame_.stamp) return true;
  // Looked at before the wait: what came until then is read by it.
  const bool last_look = recording_
                             ? depth_.gate->waiting() || events_.ended() ||
                                   Monotonic::now() - depth_came_ > kPlayerSilence
                             : events_.gone() || Monotonic::now() - depth_came_ > kLiveGrayWait;
  if (wait(false, last_look ? 0 : 2) != Got::kColour) return last_look;
  take_colour();
  return newest() && *newest() >= frame_.stamp;
}

DepthFrame Capture::deliver() noexcept {
  const auto view_of = [this](const auto& pixels) {
    return ImageView<typename std::decay_t<decltype(pixels)>::value_type>{
        pixels.data(), layout_.width_px, layout_.height_px, layout_.width_px};
  };
  frame_.depth = view_of(pixels_);
  frame_.gray = {};
  Duration best_off = kGrayTolerance;
  for (const GrayImage& gray : grays_) {
    if (!gray.stamp) continue;
    const Duration off = std::chrono::abs(*gray.stamp - frame_.stamp);
    if (off > best_off) continue;
    frame_.gray = view_of(gray.pixels);
    best_off = off;
  }
  have_depth_ = false;
  ++counters_.read;
  return frame_;
}

/// A whole wait without a frame: over, broken, or only slow (kTimeout).
Expected<DepthFrame> Capture::nothing_came(bool ended) noexcept {
  const auto silence = Monotonic::now() - last_came_;
  if (!recording_) {
    if (silence < kLiveSilence) return fail(ErrorCode::kTimeout, "no frame yet");
    detail_ = line("openni2: {}: sends no frames", uri_);
    return fail(ErrorCode::kDevice, "camera sends no frames");
  }
  if (!ended && silence < kPlayerSilence) return fail(ErrorCode::kTimeout, "no frame yet");
  const std::uint64_t seen = counters_.read + counters_.unreadable + counters_.out_of_order;
  if (length_ && seen < *length_) {
    detail_ = line("openni2: {}: {} of {} frames can be played: damaged or cut off", uri_,
                   counters_.read, *length_);
    counters_.unreadable += *length_ - seen;
  }
  stop();  // a player at the end would keep a processor busy
  return fail(ErrorCode::kEnd, "recording is over");
}

Expected<DepthFrame> Capture::next(Deadline deadline) noexcept {
  const auto began = Monotonic::now();
  for (;;) {
    if (have_depth_) {
      if (gray_settled()) return deliver();
    } else {
      if (events_.gone() || events_.broken()) {
        detail_ =
            line("openni2: {}: {}", uri_, events_.gone() ? "disconnected" : "reports an error");
        return fail(ErrorCode::kDevice, "camera is gone");
      }
      const bool ended = events_.ended();  // before the wait: all frames came before it
      switch (wait(true, ended ? 0 : kSliceMs)) {
        case Got::kDepth:
          take_depth();
          continue;
        case Got::kColour:
          take_colour();
          break;
        case Got::kFailure:
          detail_ = line("openni2: {}: {}", uri_, last_error());
          return fail(ErrorCode::kDevice, "camera fails");
        case Got::kNothing:
          if (auto over = nothing_came(ended); over.error().code != ErrorCode::kTimeout)
            return over;
          if (!recording_ && Monotonic::now() - began > kLiveWait) {
            return fail(ErrorCode::kTimeout, "no frame yet");
          }
      }
    }
    if (deadline.expired()) return fail(ErrorCode::kTimeout, "no frame yet");
  }
}

}  // namespace maplet::openni2
