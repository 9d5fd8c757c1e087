// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/journal/mend.hpp"

#include <bit>

#include "core/base/crc.hpp"

namespace maplet::journal {

Mend mend(std::span<std::byte> bytes, std::uint32_t crc) noexcept {
  constexpr std::uint32_t kReversedPolynomial = 0x82F63B78U;
  const std::uint32_t trace = crc32c(bytes) ^ crc;
  if (trace == 0) return Mend::kWhole;
  if (std::has_single_bit(trace)) return Mend::kMended;
  std::uint32_t of_bit = 1;  // what a flip of the bit looks like, from the last one backwards
  for (std::size_t i = bytes.size(); i-- > 0;) {
    for (int bit = 7; bit >= 0; --bit) {
      of_bit = (of_bit >> 1) ^ ((of_bit & 1U) != 0U ? kReversedPolynomial : 0U);
      if (of_bit != trace) continue;
      bytes[i] ^= std::byte{1} << bit;
      return Mend::kMended;
    }
  }
  return Mend::kBroken;
}

}  // namespace maplet::journal
