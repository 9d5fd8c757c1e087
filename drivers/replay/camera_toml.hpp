// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "core/geometry/camera_model.hpp"
#include "core/geometry/se3.hpp"
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

/// What a recording says of a gray camera of its own: the table [gray] of camera.toml.
struct RecordedGray {
  CameraModel camera;
  Se3 T_depth_gray;            ///< x, y, z, qx, qy, qz, qw in the file
  double time_offset_s = 0.0;  ///< a gray image's stamp minus the time at which depth saw the same
};

/// @return the gray camera, nothing when there is no table [gray], or one line as below. Size,
///   focal lengths, principal point and T_depth_gray must be there.
[[nodiscard]] tl::expected<std::optional<RecordedGray>, std::string> parse_gray_toml(
    std::string_view text, std::string_view name);

/// @param name  stands for the file in errors
/// @return the camera, or one line: file, line, key, what is allowed. Size, focal lengths,
/// principal
///   point and metres_per_unit must be there; unknown keys of [depth] are errors, other tables are
///   not looked at.
[[nodiscard]] tl::expected<RecordedCamera, std::string> parse_camera_toml(std::string_view text,
                                                                          std::string_view name);

}  // namespace maplet
