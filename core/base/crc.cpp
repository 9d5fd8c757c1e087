// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/base/crc.hpp"

#include <array>

namespace maplet {

namespace {

constexpr std::uint32_t kReversedPolynomial = 0x82F63B78U;

constexpr auto kTable = [] {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t c = i;
    for (int k = 0; k < 8; ++k) c = (c >> 1) ^ ((c & 1U) != 0U ? kReversedPolynomial : 0U);
    table[i] = c;
  }
  return table;
}();

}  // namespace

std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t crc) noexcept {
  crc = ~crc;
  for (const std::byte b : bytes) {
    crc = kTable[(crc ^ std::to_integer<std::uint32_t>(b)) & 0xFFU] ^ (crc >> 8);
  }
  return ~crc;
}

}  // namespace maplet
