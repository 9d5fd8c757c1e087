// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <mutex>
#include <utility>

#include "core/agent/map_frame.hpp"
#include "core/agent/range_keeper.hpp"
#include "core/odometry/tracker.hpp"
#include "daemon/fill.hpp"
#include "daemon/free_axes.hpp"
#include "daemon/stage_stats.hpp"
#include "transport/exchange/status_record.hpp"

namespace maplet::daemon {

/// The newest status, for the threads that tell others.
///
/// Memory   fixed. Threads  note() by the estimator's, without waiting: when somebody reads just
///   then, the next second will do; the rest by any.
class StatusBoard {
 public:
  struct Notice {
    StatusRecord status;
    StageTime latency;     ///< from the camera's runtime having a frame to work at it
    bool settled = false;  ///< the skeleton, with every record that anybody heard holds
    std::uint64_t skeleton_digest = 0;  ///< of the records in it
    std::uint64_t records_digest = 0;   ///< of those held then
    RangeCounters ranges;
    MapFrame::Notice frame;
    FreeAxes free;  ///< of the newest frame
    TrackerCounters tracking;
    std::array<ToldHistogram, kStages> wall;  ///< of each stage
    Fills fills;
  };

  void note(const Notice& notice) noexcept {
    const std::unique_lock lock{mutex_, std::try_to_lock};
    if (lock) notice_ = notice;
  }
  [[nodiscard]] Notice read() const {
    const std::scoped_lock lock{mutex_};
    return notice_;
  }

 private:
  mutable std::mutex mutex_;
  Notice notice_;
};

}  // namespace maplet::daemon
