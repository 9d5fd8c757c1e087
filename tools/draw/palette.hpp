// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "tools/draw/canvas.hpp"

namespace maplet::draw {

// Hues from Okabe and Ito: told apart by colour-blind eyes too.
inline constexpr Colour kPaper{0xFFFFFF};
inline constexpr Colour kInk{0x1F2A33};
inline constexpr Colour kSoftInk{0x5B6770};
inline constexpr Colour kHairline{0xD5DADE};
inline constexpr Colour kFloor{0xEFF2F4};
inline constexpr Colour kTops{0xDFE5E9};
inline constexpr Colour kTopsEdge{0xC3CCD3};
inline constexpr std::array<Colour, 3> kWalls{{{0xAEB9C1}, {0x6E7B86}, {0x27323B}}};  // low to high
inline constexpr Colour kOdometry{0xE69F00};
inline constexpr Colour kClosure{0xD55E00};

/// Of an agent's path and maplets.
[[nodiscard]] constexpr Colour agent_colour(std::size_t agent) noexcept {
  constexpr std::uint32_t kAgents[] = {0x0072B2, 0x009E73, 0xCC79A7, 0x56B4E9, 0x8C6D1F, 0x5E3C99};
  return {kAgents[agent % std::size(kAgents)]};
}

}  // namespace maplet::draw
