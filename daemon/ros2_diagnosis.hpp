// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "daemon/status_board.hpp"
#include "transport/ros2/topics.hpp"

namespace maplet::daemon {

/// How the daemon is, in ROS's words.
struct Diagnosis {
  RosDiagnosis told;
  std::vector<RosDiagnosis::Value> values;  ///< told.values without the span
};

/// @param silent  the estimator has not said anything for seconds
[[nodiscard]] Diagnosis diagnose(const StatusBoard::Notice& notice, int agent, bool silent);

}  // namespace maplet::daemon
