// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace maplet::flight {

/// A depth image without loss in about a quarter of its bytes: runs of zeros, runs of differences,
/// numbers in groups of three bits (Wilson 2017, "Fast Lossless Depth Image Compression").
///
/// Time     O(pixels), ~2 ns each.
void encode_depth(std::span<const std::uint16_t> pixels, std::vector<std::byte>& out);

/// Safe on any bytes. @return whether they gave exactly out.size() pixels
[[nodiscard]] bool decode_depth(std::span<const std::byte> bytes,
                                std::span<std::uint16_t> out) noexcept;

}  // namespace maplet::flight
