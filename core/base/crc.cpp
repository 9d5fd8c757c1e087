// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/base/crc.hpp"

#include <array>
#include <bit>
#include <cstring>

namespace maplet {

namespace {

constexpr std::uint32_t kReversedPolynomial = 0x82F63B78U;

// kTables[k][b]: octet b with k octets of zero behind it. Eight octets a step (Kounavis and Berry
// 2005, "slicing-by-8").
constexpr auto kTables = [] {
  std::array<std::array<std::uint32_t, 256>, 8> tables{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t c = i;
    for (int k = 0; k < 8; ++k) c = (c >> 1) ^ ((c & 1U) != 0U ? kReversedPolynomial : 0U);
    tables[0][i] = c;
  }
  for (std::size_t k = 1; k < 8; ++k) {
    for (std::size_t i = 0; i < 256; ++i) {
      const std::uint32_t c = tables[k - 1][i];
      tables[k][i] = (c >> 8) ^ tables[0][c & 0xFFU];
    }
  }
  return tables;
}();

static_assert(std::endian::native == std::endian::little);

}  // namespace

std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t crc) noexcept {
  crc = ~crc;
  for (; bytes.size() >= 8; bytes = bytes.subspan(8)) {
    std::uint64_t next = 0;
    std::memcpy(&next, bytes.data(), 8);
    next ^= crc;
    crc = 0;
    for (unsigned k = 0; k < 8; ++k) crc ^= kTables[7 - k][(next >> (8 * k)) & 0xFFU];
  }
  for (const std::byte b : bytes) {
    crc = kTables[0][(crc ^ std::to_integer<std::uint32_t>(b)) & 0xFFU] ^ (crc >> 8);
  }
  return ~crc;
}

}  // namespace maplet
