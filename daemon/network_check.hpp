// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "daemon/self_check.hpp"
#include "transport/dds/radio_config.hpp"

namespace maplet::daemon {

/// Rows of `mapletctl check`: the interface to other agents, and whether they can be found over it.
/// Sends nothing.
void check_network(std::vector<CheckResult>& results, const RadioConfig& radio);

}  // namespace maplet::daemon
