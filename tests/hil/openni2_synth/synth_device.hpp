// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Driver/OniDriverAPI.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "tests/hil/openni2_synth/script.hpp"
#include "tests/hil/openni2_synth/synth_frames.hpp"
#include "tests/hil/openni2_synth/synth_stream.hpp"

namespace maplet::synth {

/// The camera while it is plugged in and open: a thread renders the simulator's world, or
/// plays a recording, and pushes depth, then colour, of the same instant.
class SynthDevice final : public oni::driver::DeviceBase {
 public:
  /// @param frames     counts those of all pluggings
  /// @param on_unplug  called on the camera's thread when the script pulls the cable, with the time
  ///   until it goes in again in ms, 0 = never
  SynthDevice(const Script& script, std::atomic<int>& frames,
              std::function<void(int replug_ms)> on_unplug);
  ~SynthDevice() override;

  OniStatus getSensorInfoList(OniSensorInfo** infos, int* count) override;
  oni::driver::StreamBase* createStream(OniSensorType type) override;
  void destroyStream(oni::driver::StreamBase* stream) override;

  OniStatus getProperty(int id, void* data, int* size) override;
  OniStatus setProperty(int id, const void* data, int size) override;
  OniBool isPropertySupported(int id) override;
  OniBool isImageRegistrationModeSupported(OniImageRegistrationMode mode) override;

 private:
  void run();
  /// The frame with what the script does to it. @return false: the cable is out, or the end
  [[nodiscard]] bool show(DepthFrame& frame, int index, std::uint64_t stamp_us,
                          std::chrono::steady_clock::time_point due);
  void push(const DepthFrame& frame, int index, std::uint64_t stamp_us);
  [[nodiscard]] bool sleep_until(std::chrono::steady_clock::time_point time);
  void start_thread();

  const Script script_;
  std::atomic<int>& frames_;
  const std::function<void(int)> on_unplug_;
  std::vector<std::uint16_t> pixels_;  ///< of a frame that was tampered with
  std::vector<OniVideoMode> depth_modes_;
  std::vector<OniVideoMode> colour_modes_;
  std::vector<OniSensorInfo> sensors_;
  OniImageRegistrationMode registration_ = ONI_IMAGE_REGISTRATION_OFF;

  std::mutex mutex_;  ///< guards what follows
  std::condition_variable stopped_;
  SynthStream* depth_ = nullptr;
  SynthStream* colour_ = nullptr;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace maplet::synth
