// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/static_vector.hpp"
#include "core/maplet/path_point.hpp"
#include "core/registration/maplet_range.hpp"
#include "core/skeleton/skeleton.hpp"

namespace maplet {

/// How far another agent is, as a sensor of this one measured it.
struct RangeToAgent {
  std::uint16_t other = 0;
  Stamp stamp{};  ///< our frames' clock
  RangeMeasurement measured;
  Duration clock_offset{};  ///< the other's frames' clock minus ours
};

struct RangeCounters {
  std::uint64_t measured = 0;
  std::uint64_t placed = 0;   ///< between two maplets
  std::uint64_t dropped = 0;  ///< not tracked then, the other's path unknown, or too many at once
};

/// Ranges between agents on their way into the graph: a measurement of a moment becomes one between
/// the origins of the two maplets that the agents were in, each end carried there along its path.
///
/// Our end: the first tracked frame that is not older. The other's end: its delta-poses, once one
/// spans the moment, and between their two origins at the share of the time.
///
/// Memory   fixed. Time  at_frame O(waiting); place O(factors), one range a call.
/// Threads  one.
/// Math     docs/math/maplet.md, eq. 9-10, at either end.
class RangeKeeper {
 public:
  static constexpr std::size_t kWaiting = 64;
  static constexpr Duration kLate = std::chrono::seconds{2};        ///< at the first frame after it
  static constexpr Duration kPatience = std::chrono::seconds{120};  ///< for the other's delta-poses
  static constexpr double kSpeed_m_per_s = 1.0;  ///< of what moved in a time that nobody tracked

  void note(const RangeToAgent& range) noexcept;
  [[nodiscard]] bool empty() const noexcept { return waiting_.empty(); }
  /// A frame came. @param at  where it is in its maplet; nothing: lost
  void at_frame(Stamp frame, const std::optional<PathPoint>& at) noexcept;
  /// Tries the next one that waits for the other's end.
  [[nodiscard]] std::optional<MapletRange> place(const Skeleton& skeleton) noexcept;
  [[nodiscard]] const RangeCounters& counters() const noexcept { return counters_; }

 private:
  struct Entry {
    RangeToAgent range;
    bool here = false;  ///< our end is carried: ours
    CarriedRange ours;
  };
  void drop(std::size_t index) noexcept;

  StaticVector<Entry, kWaiting> waiting_;
  std::size_t next_ = 0;
  Stamp newest_frame_{};
  RangeCounters counters_;
};

/// Where an agent was at a moment of its own clock: in the maplet whose origin is nearer in time,
/// by the delta-pose of its path that spans the moment. Nothing: none does.
[[nodiscard]] std::optional<PathPoint> path_point_of(const Skeleton& skeleton, std::uint16_t agent,
                                                     Stamp stamp) noexcept;

}  // namespace maplet
