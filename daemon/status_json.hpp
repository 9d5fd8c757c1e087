// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include "daemon/memory_status.hpp"
#include "daemon/radio_link.hpp"
#include "daemon/status_board.hpp"

namespace maplet::daemon {

/// `mapletctl status --json`. @param radio  nullptr: --no-dds
[[nodiscard]] nlohmann::ordered_json status_json(const StatusBoard::Notice& notice,
                                                 const MemoryStatus& memory,
                                                 const RadioStatus* radio);

/// One entry of its "peers".
[[nodiscard]] nlohmann::ordered_json peer_json(const RadioStatus::PeerStatus& status);

}  // namespace maplet::daemon
