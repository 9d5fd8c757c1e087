// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// In a build without libcamera.
#include "drivers/gray_camera.hpp"

namespace maplet {

namespace {

constexpr const char* kNone = "this mapletd was built without libcamera (MAPLET_LIBCAMERA)";

}  // namespace

tl::expected<std::unique_ptr<GrayCamera>, std::string> open_libcamera(const GrayCameraOptions&) {
  return tl::unexpected<std::string>{kNone};
}

tl::expected<std::vector<std::string>, std::string> libcamera_cameras() {
  return tl::unexpected<std::string>{kNone};
}

}  // namespace maplet
