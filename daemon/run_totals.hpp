// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/agent/agent.hpp"
#include "daemon/free_axes.hpp"

namespace maplet::daemon {

/// What a run counted, for report.json and status. Memory  fixed.
struct RunTotals {
  std::uint64_t processed = 0;
  std::uint64_t dropped = 0;      ///< late in recorded pace
  std::uint64_t lost = 0;         ///< processed, but not tracked
  std::uint64_t partly_free = 0;  ///< tracked, but along some direction nothing was seen
  FreeAxes free;                  ///< the worst in these
  std::uint32_t keyframes = 0;
  std::uint32_t maplets = 0;
  std::uint64_t maplet_bytes = 0;
  std::uint64_t maplet_bytes_min = 0;
  std::uint64_t maplet_bytes_max = 0;
  std::uint64_t maplet_planes = 0;
  PointShare points;                    ///< of the maplets' keyframes
  std::uint64_t point_cloud_bytes = 0;  ///< 12 x valid pixels of each origin keyframe
  std::uint32_t delta_poses = 0;
  std::uint32_t closures = 0;
  std::uint32_t ranges = 0;
  std::uint64_t unrelated = 0;  ///< delta-poses that no record could hold: gaps in the skeleton
  bool complete = true;         ///< the source's end was reached; no signal, no failure

  void add(const Step& step) noexcept {
    ++processed;
    if (step.track.state == Track::State::kLost) ++lost;
    if (step.keyframe != nullptr) ++keyframes;
    if (step.track.state == Track::State::kTracking && !step.track.free_axes.empty()) {
      ++partly_free;
      free.take_worse(free_axes_of(step.track));
    }
    if (step.closed != nullptr) add(*step.closed);
  }
  void add(const DeltaPose::Kind kind) noexcept {
    ++delta_poses;
    if (kind == DeltaPose::Kind::kClosure) ++closures;
  }
  void add(const MapletCut& closed) noexcept {
    const std::uint64_t bytes = closed.bytes.size();
    maplet_bytes_min = maplets == 0 ? bytes : std::min(maplet_bytes_min, bytes);
    maplet_bytes_max = std::max(maplet_bytes_max, bytes);
    maplet_bytes += bytes;
    maplet_planes += closed.maplet.planes.size();
    point_cloud_bytes += 12 * closed.origin_valid_pixels;
    points.seen += closed.points.seen;
    points.kept += closed.points.kept;
    ++maplets;
  }
};

}  // namespace maplet::daemon
