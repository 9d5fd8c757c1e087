// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "core/maplet/byte_stream.hpp"
#include "core/maplet/maplet.hpp"

/// Keyframes and planes as bytes: the parts of a layer besides its cells. Used by codec.cpp alone.
///
/// Math   docs/math/maplet.md, section 4.
namespace maplet::codec {

inline constexpr double kMetre = 1e4;  ///< lengths are written in 0.1 mm

/// Whether all values are finite and in range.
[[nodiscard]] bool writable(const Maplet& m) noexcept;

/// @param first  the origin (0) is not written; stamps count on from the keyframe before
void put_keyframes(const Maplet& m, std::size_t first, std::size_t count, ByteWriter& out) noexcept;
[[nodiscard]] bool get_keyframes(ByteReader& in, std::size_t count, Maplet& m) noexcept;

void put_plane(const MapletPlane& p, ByteWriter& out) noexcept;
/// Appends planes, their cells taken and clear.
[[nodiscard]] bool get_planes(ByteReader& in, std::size_t count, Maplet& m) noexcept;

}  // namespace maplet::codec
