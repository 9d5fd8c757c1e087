// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/odometry/patch_view.hpp"

namespace maplet {

/// Whether two views that lie on each other show more than bare walls: what stands in front of
/// something else, and where, tells one room's corner from the next; walls, floor and ceiling fit
/// every corner. Enough of it must be where the other view has it, both ways.
///
/// Time   O(facets), 48 to 96 probes each.
/// Math   docs/math/odometry.md, section "Lost and found"
[[nodiscard]] bool telling(const PatchView& a, const PatchView& b, const Se3& T_a_b) noexcept;

}  // namespace maplet
