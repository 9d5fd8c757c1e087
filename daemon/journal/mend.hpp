// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

namespace maplet::journal {

enum class Mend : std::uint8_t {
  kWhole,
  kMended,
  kBroken,  ///< more than a bit
};

/// Sets one flipped bit of `bytes` right, if that explains the checksum: every single bit of up to
/// 2^31 leaves its own trace in a CRC-32C. Damage of another kind looks like one flipped bit with a
/// probability of bits / 2^32: a second checksum has to agree.
///
/// Memory   none. Time O(bits) where the checksum is wrong.
/// @param crc  the CRC-32C that `bytes` should have; one whose own bit is flipped counts as mended
[[nodiscard]] Mend mend(std::span<std::byte> bytes, std::uint32_t crc) noexcept;

}  // namespace maplet::journal
