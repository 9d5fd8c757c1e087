// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "core/base/expected.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet {

/// The bytes of a maplet: what a `.maplet` file holds and what the radio carries.
///
/// Version 2, little-endian, in layers, each with a CRC-32C of all bytes up to there. Any prefix of
/// whole layers is a maplet too, a coarser one: the first layer (about 1 KB) has the largest planes
/// with blocks of cells, the second (up to about 4 KB) makes them exact and adds planes and the
/// keyframes, the third adds the rest. A sender stops at a budget by sending
/// `bytes.first(layers_within(bytes, budget))`, and sends what follows later: a receiver appends it
/// to what it has. Layout and error bounds in docs/math/maplet.md, section 4. Everybody, the origin
/// too, uses a maplet as decoded.
namespace codec {

// Bounds on what quantisation changes.
inline constexpr double kMaxNormalError_rad = 6.6e-5;
inline constexpr double kMaxOffsetError_m = 6e-5;  ///< at the plane's centre
inline constexpr double kMaxTranslationError_m = 1e-4;
inline constexpr double kMaxRotationError_rad = 1e-4;
inline constexpr double kMaxSigmaFactor = 1.06;  ///< standard deviations only ever grow
inline constexpr double kMaxDistance_m = 800.0;  ///< of a plane from the origin
inline constexpr double kMaxLean = 0.9;  ///< of a plane's normal towards its grid's axis: a cosine
inline constexpr int kMaxGridIndex = 32000;
inline constexpr int kMinCell_mm = 5;
inline constexpr int kMaxCell_mm = 1000;

inline constexpr std::size_t kHeaderBytes = 36;
inline constexpr std::size_t kMaxLayers = 3;
inline constexpr std::size_t kCoarseBytes = 1024;  ///< what the first layer aims at
inline constexpr std::size_t kMiddleBytes = 4096;  ///< the first two together

}  // namespace codec

/// @return bytes written (all layers), or kCapacity when `out` is too short, or kBadInput when the
///   maplet holds what cannot be written: no keyframe, not finite, a negative variance, cells
///   of another size than kMinCell_mm to kMaxCell_mm, further away than codec::kMaxDistance_m
[[nodiscard]] Expected<std::size_t> encode(const Maplet& maplet, std::span<std::byte> out) noexcept;

/// Where the layers of an encoded maplet end that `bytes` holds completely, bytes from its start.
/// Reads lengths only, no checksums; nothing for what is no maplet.
[[nodiscard]] StaticVector<std::size_t, codec::kMaxLayers> layer_ends(
    std::span<const std::byte> bytes) noexcept;

/// @return length of the longest run of whole layers within `max_bytes`: what to send; 0 when not
///   even the first fits
[[nodiscard]] std::size_t layers_within(std::span<const std::byte> bytes,
                                        std::size_t max_bytes) noexcept;

/// The maplet as far as `max_bytes` go: as encode() and layers_within().
/// @param out  scratch for all layers, kMaxMapletBytes
[[nodiscard]] Expected<std::size_t> encode(const Maplet& maplet, std::size_t max_bytes,
                                           std::span<std::byte> out) noexcept;

/// Which maplet it is, its checksums looked at and nothing more: decode() may still refuse it.
/// Time   O(bytes), a hundredth of decode()'s
[[nodiscard]] Expected<MapletKey> key_of(std::span<const std::byte> bytes) noexcept;

/// Safe on any bytes. `out` is unspecified after an error; out.complete says whether all layers
/// were there.
/// @return nothing, or kBadInput: too short or long, not at the end of a layer, checksum, newer
///   version, values out of range
[[nodiscard]] Expected<void> decode(std::span<const std::byte> bytes, Maplet& out) noexcept;

}  // namespace maplet
