// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/openni2/runtime.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

namespace maplet::openni2 {

bool start_runtime() noexcept {
  static bool started = false;
  if (!started) started = openni::OpenNI::initialize() == openni::STATUS_OK;
  return started;
}

std::string last_error() {
  std::string text = openni::OpenNI::getExtendedError();
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20; }, ' ');
  const auto first = text.find_first_not_of(' ');
  if (first == std::string::npos) return "unknown reason";
  return text.substr(first, text.find_last_not_of(' ') - first + 1);
}

std::vector<std::string> camera_uris() {
  openni::Array<openni::DeviceInfo> devices;
  openni::OpenNI::enumerateDevices(&devices);
  std::vector<std::string> uris;
  for (int i = 0; i < devices.getSize(); ++i) {
    constexpr std::string_view kRecording = "oni File";  // the name that the file player gives
    if (devices[i].getName() != kRecording) uris.emplace_back(devices[i].getUri());
  }
  return uris;
}

DeviceEvents::DeviceEvents(std::string uri) : uri_{std::move(uri)} {
  openni::OpenNI::addDeviceDisconnectedListener(this);
  openni::OpenNI::addDeviceStateChangedListener(this);
}

DeviceEvents::~DeviceEvents() {
  openni::OpenNI::removeDeviceDisconnectedListener(this);
  openni::OpenNI::removeDeviceStateChangedListener(this);
}

void DeviceEvents::onDeviceDisconnected(const openni::DeviceInfo* info) {
  if (uri_ == info->getUri()) gone_ = true;
}

void DeviceEvents::onDeviceStateChanged(const openni::DeviceInfo* info, openni::DeviceState state) {
  if (uri_ == info->getUri()) state_ = state;
}

}  // namespace maplet::openni2
