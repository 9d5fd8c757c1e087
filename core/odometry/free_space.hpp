// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "core/odometry/patch_aligner.hpp"

namespace maplet {

/// What moved in the frame before and is still there, or thereabouts, moves in this one.
///
/// Time   O(patches)
void carry_marks(PatchView& frame, const PatchView& before) noexcept;

/// Marks what does not stand still: where one view sees through the place of another's surface,
/// that surface came or went. What lies on a marked surface of a keyframe, and on no other one, is
/// marked, too, and so is what hangs together with it, or was carried over, and no keyframe knows.
/// Nothing is marked where half of the image would be, unless little of that is new: then the pose
/// is doubtful.
///
/// @return share of the frame's pixels that are marked
/// @param keyframes  without the frame before; their facets are marked, too
/// @param before     share that was marked in the frame before
/// Time   O(keyframes * patches)
/// Math   docs/math/odometry.md, section "What moves"
double mark_what_moves(PatchView& frame, std::span<const Reference> keyframes,
                       const Se3& T_odom_camera, double before) noexcept;

/// Between frames far apart what moves leaps too far to be followed by mistake.
void trust_all(PatchView& frame) noexcept;

}  // namespace maplet
