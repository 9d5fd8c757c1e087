// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/base/clock.hpp"
#include "transport/exchange/status_record.hpp"

namespace maplet::daemon {

/// Tells systemd how the service is; does nothing when systemd did not start it.
void notify_ready() noexcept;
void notify_reloading() noexcept;  ///< notify_ready() ends it
void notify_stopping() noexcept;
void notify_watchdog() noexcept;
/// @param status  one line for `systemctl status`
void notify_status(const char* status) noexcept;

/// What the unit's WatchdogSec gives us between two notify_watchdog(); 0 = there is none.
[[nodiscard]] Duration watchdog_patience() noexcept;

/// How the daemon is, for a person: "tracking, 1234 frames, 17 maplets, 2 closures".
[[nodiscard]] std::string service_line(const StatusRecord& status);

}  // namespace maplet::daemon
