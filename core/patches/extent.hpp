// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "core/base/static_vector.hpp"
#include "core/patches/patch.hpp"

namespace maplet {

/// Corners of a plane's extent, camera frame, m.
inline constexpr std::size_t kMaxExtentCorners = 16;
using PlaneExtent = StaticVector<Eigen::Vector3d, kMaxExtentCorners>;

/// Where a patch lies on its own plane: its rectangle of pixels seen on the plane, clockwise in the
/// image from the top left. Points at or behind the camera's plane do not occur: a patch was seen.
/// O(1).
[[nodiscard]] std::array<Eigen::Vector3d, 4> quadrangle(const Patch& patch,
                                                        const CameraModel& camera) noexcept;

/// A convex polygon on plane `plane` of the set around all its patches: of their corners those that
/// lie farthest in 16 directions, clockwise in the image. Empty when the plane has no patch (it is
/// made of quarters of cells). O(patches).
[[nodiscard]] PlaneExtent extent(const PatchSet& set, std::size_t plane) noexcept;

}  // namespace maplet
