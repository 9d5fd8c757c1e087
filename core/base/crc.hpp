// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace maplet {

/// CRC-32C (Castagnoli, RFC 3720): of every file, record and datagram of ours.
///
/// @param crc  of the bytes before these, to go on with; 0 at the start
[[nodiscard]] std::uint32_t crc32c(std::span<const std::byte> bytes,
                                   std::uint32_t crc = 0) noexcept;

}  // namespace maplet
