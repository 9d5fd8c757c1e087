// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "core/geometry/camera_model.hpp"
#include "drivers/source.hpp"

namespace maplet {

/// What a recording says of its depth camera: the table [depth] of camera.toml.
struct RecordedCamera {
  CameraModel camera;
  double metres_per_unit = 0.0;
  InvalidValues invalid_values;       ///< besides 0
  bool registered_to_colour = false;  ///< colour images have the viewpoint of depth
  double rate_hz = 0.0;               ///< 0 = not said
};

/// @param name  stands for the file in errors
/// @return the camera, or one line: file, line, key, what is allowed. Size, focal lengths,
/// principal
///   point and metres_per_unit must be there; unknown keys of [depth] are errors, other tables are
///   not looked at.
[[nodiscard]] tl::expected<RecordedCamera, std::string> parse_camera_toml(std::string_view text,
                                                                          std::string_view name);

}  // namespace maplet
