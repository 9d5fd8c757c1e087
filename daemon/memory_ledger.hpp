// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "daemon/config.hpp"

namespace maplet::daemon {

/// What --print-memory prints: every component of the arena with count and bytes, and the total.
/// Builds the stages once to ask them; touches no camera and no network.
[[nodiscard]] std::string memory_ledger(const Config& config);

}  // namespace maplet::daemon
