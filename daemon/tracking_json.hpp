// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include "core/odometry/tracker.hpp"
#include "daemon/free_axes.hpp"

namespace maplet::daemon {

/// What the odometry counted, for report.json and status (docs/output.md).
void add_tracking(const TrackerCounters& counted, nlohmann::ordered_json& json);
/// free_sigma_m, free_axis, free_turn_sigma_rad, free_turn_axis; axes are null where nothing is
/// free.
void add_free_axes(const FreeAxes& free, nlohmann::ordered_json& json);

}  // namespace maplet::daemon
