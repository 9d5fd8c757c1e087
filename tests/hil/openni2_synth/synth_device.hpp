// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Driver/OniDriverAPI.h>

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "drivers/sim/sim_source.hpp"
#include "tests/hil/openni2_synth/script.hpp"
#include "tests/hil/openni2_synth/synth_stream.hpp"

namespace maplet::synth {

/// The camera while it is plugged in and open: a thread renders the simulator's world and pushes
/// depth, then colour, of the same instant.
class SynthDevice final : public oni::driver::DeviceBase {
 public:
  /// @param on_unplug  called on the camera's thread when the script pulls the cable
  SynthDevice(const Script& script, std::function<void()> on_unplug);
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
  void start_thread();

  const Script script_;
  const std::function<void()> on_unplug_;
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
