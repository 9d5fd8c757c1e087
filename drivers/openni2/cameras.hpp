// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <vector>

namespace maplet {

/// A camera that the OpenNI2 runtime sees.
struct CameraInfo {
  std::string uri;
  std::string name;         ///< vendor and product
  std::string depth_modes;  ///< "640x480 mm 30 Hz, ..."; empty: no depth, or `problem`
  std::string problem;      ///< why it does not open; empty: it does
};

/// The cameras that are there now, each opened for a moment: not while one is in use.
/// @return why the runtime does not start, on one line
[[nodiscard]] tl::expected<std::vector<CameraInfo>, std::string> openni2_cameras();

}  // namespace maplet
