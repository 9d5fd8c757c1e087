// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenNI.h>

#include <atomic>
#include <optional>
#include <string>
#include <vector>

namespace maplet::openni2 {

/// The OpenNI2 runtime, initialised as long as this lives. It counts: sources may overlap.
class Runtime {
 public:
  Runtime() noexcept : status_{openni::OpenNI::initialize()} {}
  ~Runtime() { openni::OpenNI::shutdown(); }
  Runtime(const Runtime&) = delete;
  Runtime& operator=(const Runtime&) = delete;

  [[nodiscard]] bool good() const noexcept { return status_ == openni::STATUS_OK; }

 private:
  openni::Status status_;
};

/// What OpenNI2 says of the last failure, in one line; "unknown reason" when it says nothing.
[[nodiscard]] std::string last_error();

/// The cameras that are there now; recordings that were opened do not count.
[[nodiscard]] std::vector<std::string> camera_uris();

/// What happens to one device, told by the runtime's threads.
class DeviceEvents final : public openni::OpenNI::DeviceDisconnectedListener,
                           public openni::OpenNI::DeviceStateChangedListener {
 public:
  explicit DeviceEvents(std::string uri);
  ~DeviceEvents() override;
  DeviceEvents(const DeviceEvents&) = delete;
  DeviceEvents& operator=(const DeviceEvents&) = delete;

  [[nodiscard]] bool gone() const noexcept { return gone_; }
  [[nodiscard]] bool broken() const noexcept { return state_ == openni::DEVICE_STATE_ERROR; }
  [[nodiscard]] bool ended() const noexcept { return state_ == openni::DEVICE_STATE_EOF; }

 private:
  void onDeviceDisconnected(const openni::DeviceInfo* info) override;
  void onDeviceStateChanged(const openni::DeviceInfo* info, openni::DeviceState state) override;

  const std::string uri_;
  std::atomic<bool> gone_{false};
  std::atomic<int> state_{openni::DEVICE_STATE_OK};
};

}  // namespace maplet::openni2
