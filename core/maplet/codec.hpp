// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "core/base/expected.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet {

/// The bytes of a maplet: what a `.maplet` file holds and what the radio carries.
///
/// Version 1, little-endian, CRC-32C at the end; layout and error bounds in
/// docs/math/maplet.md, section 4. Everybody, the origin too, uses a maplet as decoded.
namespace codec {

// Bounds on what quantisation changes.
inline constexpr double kMaxNormalError_rad = 6.6e-5;
inline constexpr double kMaxOffsetError_m = 6e-5;  ///< at the plane's centre
inline constexpr double kMaxTranslationError_m = 1e-4;
inline constexpr double kMaxRotationError_rad = 1e-4;
inline constexpr double kMaxSigmaFactor = 1.06;  ///< standard deviations only ever grow
inline constexpr double kMaxDistance_m = 800.0;  ///< of a plane from the origin

inline constexpr std::size_t kHeaderBytes = 32;

}  // namespace codec

/// @return bytes written, or kCapacity when `out` is too short, or kBadInput when the maplet holds
///   what cannot be written: no keyframe, not finite, further away than codec::kMaxDistance_m
[[nodiscard]] Expected<std::size_t> encode(const Maplet& maplet, std::span<std::byte> out) noexcept;

/// Safe on any bytes. `out` is unspecified after an error.
/// @return nothing, or kBadInput: too short or long, checksum, newer version, values out of range
[[nodiscard]] Expected<void> decode(std::span<const std::byte> bytes, Maplet& out) noexcept;

}  // namespace maplet
