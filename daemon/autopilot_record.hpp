// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "daemon/output_frames.hpp"

namespace maplet::daemon {

/// The pose as an autopilot's bridge takes it. docs/output.md has the layout, byte by byte.
struct AutopilotRecord {
  static constexpr std::array<char, 4> kMagic{'M', 'L', 'P', 'O'};
  static constexpr std::uint8_t kVersion = 1;
  static constexpr std::size_t kBytes = 316;
  // Flags.
  static constexpr std::uint8_t kTracking = 1;
  static constexpr std::uint8_t kPartlyFree = 2;
  static constexpr std::uint8_t kMoves = 4;
  static constexpr std::uint8_t kSystemClock = 8;

  OutputFrame frame = OutputFrame::kEnuFlu;
  std::uint8_t flags = 0;
  std::uint8_t reset_counter = 0;
  std::uint16_t agent = 0;
  std::uint32_t sequence = 0;
  std::int64_t stamp_ns = 0;
  std::uint32_t age_us = 0;
  std::uint32_t map_jumps = 0;
  OutsidePose pose;  ///< in the axes of `frame`
};

using AutopilotBytes = std::array<std::byte, AutopilotRecord::kBytes>;

/// Time: about 2 us. No allocation.
[[nodiscard]] AutopilotBytes to_bytes(const AutopilotRecord& record) noexcept;

}  // namespace maplet::daemon
