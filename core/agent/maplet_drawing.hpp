// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/maplet/maplet.hpp"
#include "core/patches/patch.hpp"

namespace maplet {

/// The patches that a camera would have of a maplet's planes: a square of the image each, where the
/// ray through its middle first meets a surface that was seen, on its seen side. As certain as the
/// plane there and a sensor's noise over the square allow.
///
/// @param out  patches and planes are filled in, its cells are not
/// Time   O(squares * planes), 768 squares of a 640 x 480 image
/// Math   docs/math/odometry.md, eq. 19
void draw_maplet(const Maplet& maplet, const Se3& T_maplet_camera, const CameraModel& camera,
                 PatchSet& out) noexcept;

}  // namespace maplet
