// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tests/hil/openni2_synth/synth_device.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>

namespace maplet::synth {

namespace {

SynthStream::Optics optics_of(const CameraModel& camera) {
  return {static_cast<float>(2.0 * std::atan(0.5 * camera.width_px / camera.fx_px)),
          static_cast<float>(2.0 * std::atan(0.5 * camera.height_px / camera.fy_px))};
}

}  // namespace

SynthDevice::SynthDevice(const Script& script, std::atomic<int>& frames,
                         std::function<void(int)> on_unplug)
    : script_{script}, frames_{frames}, on_unplug_{std::move(on_unplug)} {
  const int fps = script.claimed_hz >= 0 ? script.claimed_hz : static_cast<int>(script.rate_hz);
  for (const ImageSize size : Frames::sizes(script)) {
    depth_modes_.push_back({ONI_PIXEL_FORMAT_DEPTH_1_MM, size.width_px, size.height_px, fps});
    colour_modes_.push_back({ONI_PIXEL_FORMAT_RGB888, size.width_px, size.height_px, fps});
  }
  const auto count = [](const auto& modes) { return static_cast<int>(modes.size()); };
  if (script.depth) {
    sensors_.push_back({ONI_SENSOR_DEPTH, count(depth_modes_), depth_modes_.data()});
  }
  if (script.colour) {
    sensors_.push_back({ONI_SENSOR_COLOR, count(colour_modes_), colour_modes_.data()});
  }
}

SynthDevice::~SynthDevice() {
  {
    const std::lock_guard lock{mutex_};
    stop_ = true;
  }
  stopped_.notify_all();
  if (thread_.joinable()) thread_.join();
}

OniStatus SynthDevice::getSensorInfoList(OniSensorInfo** infos, int* count) {
  *infos = sensors_.data();
  *count = static_cast<int>(sensors_.size());
  return ONI_STATUS_OK;
}

oni::driver::StreamBase* SynthDevice::createStream(OniSensorType type) {
  const bool depth = type == ONI_SENSOR_DEPTH;
  if (!depth && type != ONI_SENSOR_COLOR) return nullptr;
  auto* stream = new SynthStream{type, depth ? depth_modes_[0] : colour_modes_[0],
                                 optics_of(Frames{script_, 320}.camera()), script_.mirror,
                                 [this] { start_thread(); }};
  const std::lock_guard lock{mutex_};
  (depth ? depth_ : colour_) = stream;
  return stream;
}

void SynthDevice::destroyStream(oni::driver::StreamBase* stream) {
  {
    const std::lock_guard lock{mutex_};  // waits for a push through it
    if (depth_ == stream) depth_ = nullptr;
    if (colour_ == stream) colour_ = nullptr;
  }
  delete stream;
}

void SynthDevice::start_thread() {
  const std::lock_guard lock{mutex_};
  if (!thread_.joinable()) thread_ = std::thread{[this] { run(); }};
}

void SynthDevice::run() {
  std::optional<Frames> frames;
  {
    const std::lock_guard lock{mutex_};
    SynthStream* any = depth_ != nullptr ? depth_ : colour_;
    if (any != nullptr) frames.emplace(script_, any->mode().resolutionX);
  }
  if (!frames) return;
  auto began = std::chrono::steady_clock::now();
  std::chrono::microseconds stood{};
  for (int i = 0;; ++i) {
    if (script_.unplug > 0 && i == script_.unplug) return on_unplug_(script_.replug_ms);
    if (script_.silent > 0 && i == script_.silent) return;
    for (const Fault& fault : script_.faults) {  // time passes, and the world stands still
      if (fault.frame != frames_ + 1 || fault.kind != Fault::Kind::kStall) continue;
      script_.say("begins", fault);
      stood += std::chrono::milliseconds{fault.amount};
    }
    auto shown = frames->next();
    if (!shown) return;
    const auto since = shown->since + stood;
    if (!show(shown->frame, i + 1, static_cast<std::uint64_t>(since.count()), began + since))
      return;
  }
}

bool SynthDevice::sleep_until(std::chrono::steady_clock::time_point time) {
  std::unique_lock lock{mutex_};
  return !stopped_.wait_until(lock, time, [this] { return stop_; });
}

bool SynthDevice::show(DepthFrame& frame, int index, std::uint64_t stamp_us,
                       std::chrono::steady_clock::time_point due) {
  using Kind = Fault::Kind;
  const int at = ++frames_;
  bool twice = false;
  for (const Fault& fault : script_.faults) {
    if (fault.kind == Kind::kBlack && fault.lasts(at)) {
      pixels_.assign(static_cast<std::size_t>(frame.depth.width_px) * frame.depth.height_px, 0);
      frame.depth.pixels = pixels_.data();
      frame.depth.stride_px = frame.depth.width_px;
    }
    if (fault.kind == Kind::kBurst && fault.lasts(at)) due = {};
    if (fault.frame != at) continue;
    if (fault.kind != Kind::kStall) script_.say("begins", fault);
    if (fault.kind == Kind::kUnplug) {
      on_unplug_(fault.amount);
      return false;
    }
    if (fault.kind == Kind::kLate) due += std::chrono::milliseconds{fault.amount};
    if (fault.kind == Kind::kBackwards) {
      stamp_us -= std::min<std::uint64_t>(stamp_us, 1000ULL * static_cast<unsigned>(fault.amount));
    }
    twice = twice || fault.kind == Kind::kDuplicate;
  }
  if (!sleep_until(due)) return false;
  for (const Fault& fault : script_.faults) {
    if (at == fault.returns()) script_.say("over", fault);
  }
  push(frame, index, stamp_us);
  if (twice) push(frame, index, stamp_us);
  return true;
}

void SynthDevice::push(const DepthFrame& frame, int index, std::uint64_t stamp_us) {
  SynthStream::Damage damage = SynthStream::Damage::kNone;
  bool colour = true;
  for (const Fault& fault : script_.faults) {
    if (!fault.lasts(frames_)) continue;
    if (fault.kind == Fault::Kind::kCorrupt) damage = SynthStream::Damage::kShort;
    if (fault.kind == Fault::Kind::kMode) damage = SynthStream::Damage::kHalfSize;
    if (fault.kind == Fault::Kind::kNoColour) colour = false;
  }
  const std::lock_guard lock{mutex_};
  if (depth_ != nullptr) depth_->push(frame, index, stamp_us, damage);
  if (colour_ != nullptr && colour && !frame.gray.empty())
    colour_->push(frame, index, stamp_us, SynthStream::Damage::kNone);
}

OniStatus SynthDevice::getProperty(int id, void* data, int* size) {
  if (id != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION) return ONI_STATUS_NOT_SUPPORTED;
  return answer(registration_, data, size);
}

OniStatus SynthDevice::setProperty(int id, const void* data, int size) {
  if (id != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION || !script_.registration) {
    return ONI_STATUS_NOT_SUPPORTED;
  }
  return accept(registration_, data, size) ? ONI_STATUS_OK : ONI_STATUS_BAD_PARAMETER;
}

OniBool SynthDevice::isPropertySupported(int id) {
  return id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION;
}

OniBool SynthDevice::isImageRegistrationModeSupported(OniImageRegistrationMode mode) {
  return mode == ONI_IMAGE_REGISTRATION_OFF || script_.registration;
}

}  // namespace maplet::synth
