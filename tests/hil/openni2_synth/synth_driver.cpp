// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// An OpenNI2 driver module: a camera that sees the simulator's world and fails as MAPLET_SYNTH says
// (script.hpp). The real runtime loads it from a private folder of drivers.
#include <Driver/OniDriverAPI.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <thread>

#include "tests/hil/openni2_synth/script.hpp"
#include "tests/hil/openni2_synth/synth_device.hpp"

namespace maplet::synth {

class SynthDriver final : public oni::driver::DriverBase {
 public:
  explicit SynthDriver(OniDriverServices* services) : DriverBase{services} {
    std::snprintf(info_.uri, sizeof info_.uri, "synth://camera");
    std::snprintf(info_.vendor, sizeof info_.vendor, "mapletd");
    std::snprintf(info_.name, sizeof info_.name, "synthetic camera");
  }
  ~SynthDriver() override { shutdown(); }

  OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                       oni::driver::DeviceDisconnectedCallback disconnected,
                       oni::driver::DeviceStateChangedCallback changed, void* cookie) override {
    const auto status = DriverBase::initialize(connected, disconnected, changed, cookie);
    const Script script = Script::from_environment();
    plugged_ = !script.absent && status == ONI_STATUS_OK;
    if (plugged_) deviceConnected(&info_);
    if (script.absent && script.absent_ms > 0) plug_in_later(script.absent_ms);
    return status;
  }

  oni::driver::DeviceBase* deviceOpen(const char* uri, const char* /*mode*/) override {
    const std::lock_guard lock{mutex_};
    if (!plugged_ || std::strcmp(uri, info_.uri) != 0) return nullptr;
    script_ = Script::from_environment();
    return new SynthDevice{script_, frames_, [this](int replug_ms) { unplug(replug_ms); }};
  }
  void deviceClose(oni::driver::DeviceBase* device) override { delete device; }

  OniStatus tryDevice(const char* /*uri*/) override { return ONI_STATUS_ERROR; }

  void shutdown() override {
    {
      const std::lock_guard lock{mutex_};
      stop_ = true;
    }
    stopped_.notify_all();
    if (hand_.joinable()) hand_.join();
  }

 private:
  void unplug(int replug_ms) {
    {
      const std::lock_guard lock{mutex_};
      plugged_ = false;
    }
    deviceDisconnected(&info_);
    if (replug_ms > 0) plug_in_later(replug_ms);
  }

  void plug_in_later(int delay_ms) {
    if (hand_.joinable()) hand_.join();
    hand_ = std::thread{[this, delay_ms] { plug_in(std::chrono::milliseconds{delay_ms}); }};
  }

  void plug_in(std::chrono::milliseconds delay) {
    std::unique_lock lock{mutex_};
    if (stopped_.wait_for(lock, delay, [this] { return stop_; })) return;
    plugged_ = true;
    script_.say("over", {.name = "unplug"});
    lock.unlock();
    deviceConnected(&info_);
  }

  OniDeviceInfo info_{};
  std::mutex mutex_;  ///< guards what follows
  Script script_;
  std::condition_variable stopped_;
  bool plugged_ = false;
  bool stop_ = false;
  std::atomic<int> frames_{0};  ///< pushed by all devices
  std::thread hand_;
};

}  // namespace maplet::synth

// OpenNI2's own, which it does not ship.
#define XN_NEW(Type, argument) new Type(argument)
#define XN_DELETE(pointer) delete (pointer)
ONI_EXPORT_DRIVER(maplet::synth::SynthDriver)
