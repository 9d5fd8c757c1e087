// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Driver/OniDriverAPI.h>

#include <atomic>
#include <cstring>
#include <functional>
#include <type_traits>

#include "core/frame/depth_frame.hpp"

namespace maplet::synth {

/// Answers a property request. OpenNI2 passes sizes along: a wrong one is refused.
template <class T>
OniStatus answer(const T& value, void* data, int* size) {
  if (*size != static_cast<int>(sizeof value)) return ONI_STATUS_BAD_PARAMETER;
  std::memcpy(data, &value, sizeof value);
  return ONI_STATUS_OK;
}

template <class T>
bool accept(T& value, const void* data, int size) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (size != static_cast<int>(sizeof value)) return false;
  std::memcpy(&value, data, sizeof value);
  return true;
}

/// A stream of the synthetic camera: the device's thread pushes frames through it.
class SynthStream final : public oni::driver::StreamBase {
 public:
  struct Optics {
    float horizontal_fov_rad;
    float vertical_fov_rad;
  };

  SynthStream(OniSensorType type, OniVideoMode mode, Optics optics, bool stuck_mirror,
              std::function<void()> on_start)
      : type_{type},
        mode_{mode},
        optics_{optics},
        stuck_mirror_{stuck_mirror},
        mirror_{TRUE},  // as PS1080 cameras start up
        on_start_{std::move(on_start)} {}

  OniStatus getProperty(int id, void* data, int* size) override;
  OniStatus setProperty(int id, const void* data, int size) override;
  OniBool isPropertySupported(int id) override;
  void notifyAllProperties() override;

  OniStatus start() override {
    started_ = true;
    on_start_();
    return ONI_STATUS_OK;
  }
  void stop() override { started_ = false; }

  /// Hands an image to the runtime, unless the stream stands still.
  enum class Damage { kNone, kShort, kHalfSize };
  void push(const DepthFrame& frame, int index, std::uint64_t stamp_us, Damage damage);

  [[nodiscard]] const OniVideoMode& mode() const { return mode_; }

 private:
  [[nodiscard]] int stride_bytes() const;
  void fill(OniFrame& out, const DepthFrame& frame) const;

  const OniSensorType type_;
  OniVideoMode mode_;
  const Optics optics_;
  const bool stuck_mirror_;
  OniBool mirror_;
  std::function<void()> on_start_;
  std::atomic<bool> started_{false};
};

}  // namespace maplet::synth
