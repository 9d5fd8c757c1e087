// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "core/patches/block.hpp"

/// What the vectorised variants share: where the valid pixels of a block lie.
namespace maplet::block {

/// Of a row of 8 pixels by its bits: how many, and sums of u and u^2.
struct RowCount {
  std::uint8_t n, u, uu;
};
inline constexpr std::array<RowCount, 256> kRowCounts = [] {
  std::array<RowCount, 256> out{};
  for (unsigned bits = 0; bits < 256; ++bits) {
    for (unsigned u = 0; u < 8; ++u) {
      if ((bits >> u & 1U) == 0) continue;
      out[bits].n = static_cast<std::uint8_t>(out[bits].n + 1);
      out[bits].u = static_cast<std::uint8_t>(out[bits].u + u);
      out[bits].uu = static_cast<std::uint8_t>(out[bits].uu + u * u);
    }
  }
  return out;
}();

/// Adds row v with the valid pixels `bits`.
inline void count_row(unsigned bits, int v, BlockSums& out) noexcept {
  const RowCount& row = kRowCounts[bits];
  out.n += row.n;
  out.u += row.u;
  out.uu += row.uu;
  out.v += v * row.n;
  out.uv += v * row.u;
  out.vv += v * v * row.n;
}

/// All pixels of a block of 8 rows are valid.
inline void count_full(BlockSums& out) noexcept {
  out.n = 64;
  out.u = out.v = 224;
  out.uu = out.vv = 1120;
  out.uv = 784;
}

/// The reference of a block: its middle pixel, or the nearest valid one (block.cpp has the same).
[[nodiscard]] std::int32_t reference(const std::uint16_t* pixels, std::ptrdiff_t stride_px,
                                     int columns, int rows, const DepthScale& scale) noexcept;

}  // namespace maplet::block
