// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "transport/ros2/ros2_config.hpp"

namespace maplet {

/// The DDS topic of a ROS 2 topic: rt/, the namespace, the name. A name that begins with a slash
/// has no namespace before it.
[[nodiscard]] std::string dds_topic(const std::string& name_space, const std::string& name);

/// What of the names is none that ROS 2 takes, on one line with the remedy; empty when all are.
[[nodiscard]] std::string names_problem(const Ros2Config& config);

}  // namespace maplet
