// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include "daemon/neighbours.hpp"

namespace maplet::daemon {

/// Adds ros2, external_odometry and autopilot to a status, those that are used.
void add_neighbours(const Neighbours::Status& status, nlohmann::ordered_json& json);

}  // namespace maplet::daemon
