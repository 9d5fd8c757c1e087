// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/openni2/cameras.hpp"

#include <OpenNI.h>

#include "drivers/openni2/runtime.hpp"
#include "drivers/openni2/video_mode.hpp"

namespace maplet {

tl::expected<std::vector<CameraInfo>, std::string> openni2_cameras() {
  if (!openni2::start_runtime()) return tl::unexpected{openni2::last_error()};
  std::vector<CameraInfo> cameras;
  for (const std::string& uri : openni2::camera_uris()) {
    CameraInfo& camera = cameras.emplace_back();
    camera.uri = uri;
    openni::Device device;
    if (device.open(uri.c_str()) != openni::STATUS_OK) {
      camera.problem = openni2::last_error();
      continue;
    }
    const openni::DeviceInfo& info = device.getDeviceInfo();
    camera.name = std::string{info.getVendor()} + " " + info.getName();
    if (const auto* sensor = device.getSensorInfo(openni::SENSOR_DEPTH)) {
      camera.depth_modes = openni2::list_modes(*sensor);
    }
    device.close();
  }
  return cameras;
}

}  // namespace maplet
