// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenNI.h>

#include <optional>
#include <string>

#include "core/geometry/camera_model.hpp"

namespace maplet::openni2 {

/// Metres of one unit; nothing when the format is not depth that we read.
[[nodiscard]] std::optional<double> metres_per_unit(openni::PixelFormat format) noexcept;

/// True for colour formats that become gray here.
[[nodiscard]] bool becomes_gray(openni::PixelFormat format) noexcept;

/// The depth mode to run: the wanted size (any: 640x480, else the nearest to it), millimetres
/// before finer units, 30 Hz before other rates; never one that claims 0 Hz.
/// @param wanted  width_px 0 = any
[[nodiscard]] std::optional<openni::VideoMode> choose_depth_mode(const openni::SensorInfo& sensor,
                                                                 const CameraModel& wanted);

/// The colour mode that goes with a depth mode: same size and, where there is a choice, same rate.
[[nodiscard]] std::optional<openni::VideoMode> choose_colour_mode(const openni::SensorInfo& sensor,
                                                                  const openni::VideoMode& depth);

/// "640x480 mm 30 Hz, 320x240 mm 30 Hz, ..."
[[nodiscard]] std::string list_modes(const openni::SensorInfo& sensor);

/// Pinhole camera with the principal point in the middle.
/// @return nothing when the angles are no field of view
[[nodiscard]] std::optional<CameraModel> camera_from_fov(int width_px, int height_px,
                                                         double horizontal_rad,
                                                         double vertical_rad) noexcept;

}  // namespace maplet::openni2
