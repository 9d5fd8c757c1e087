// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/agent/agent.hpp"
#include "transport/exchange/delta_pose_record.hpp"

namespace maplet::daemon {

/// A mark of what each stage made of a frame: equal runs have equal marks, and the first that
/// differs says in which frame and stage two runs part (`mapletctl diff`).
///
/// Memory   none. Time O(planes + bytes of a maplet that was cut).
struct FrameDigest {
  std::uint32_t patches = 0;
  std::uint32_t odometry = 0;
  std::uint32_t maplet = 0;
  std::uint32_t registration = 0;
  std::uint32_t skeleton = 0;
};

[[nodiscard]] FrameDigest digest_of(const Step& step, std::span<const DeltaPoseRecord> records,
                                    const Skeleton& skeleton) noexcept;

}  // namespace maplet::daemon
