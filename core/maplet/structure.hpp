// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/patches/patch.hpp"

namespace maplet {

/// How much of a view tells places apart, m: what is no wall or floor, by the roots of its areas,
/// as far as it holds a camera in all three directions. A maplet's boundary goes where this is
/// large (paper: the third consideration for Algorithm 1).
///
/// Time  O(planes).
/// Math  docs/math/maplet.md, eq. 8b.
[[nodiscard]] double structure_of(const PatchSet& set) noexcept;

}  // namespace maplet
