// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/geometry/se3.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet {

/// Maplets of one path that overlap share keyframes, and with them their noise.
/// @return T_a_b as the first one that they share has it (m; b's frame to a's); nullopt: they share
/// none, or are of different lives
///
/// Time   O(keyframes_a * keyframes_b). Memory  none. Threads  any.
[[nodiscard]] std::optional<Se3> shared_keyframe(const Maplet& a, const Maplet& b) noexcept;

}  // namespace maplet
