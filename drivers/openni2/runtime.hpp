// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenNI.h>

#include <atomic>
#include <optional>
#include <string>
#include <vector>

namespace maplet::openni2 {

/// Starts the OpenNI2 runtime, once for the life of the process: every start and shutdown leaks
/// about 100 kB of its own, and a service that waits for its camera would do it again and again.
/// Cameras that come and go meanwhile are its drivers' business.
/// @return false when it does not start; the next call tries again
[[nodiscard]] bool start_runtime() noexcept;

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
