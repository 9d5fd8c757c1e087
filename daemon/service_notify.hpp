// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace maplet::daemon {

/// Tells systemd how the service is; does nothing when systemd did not start it.
void notify_ready() noexcept;
void notify_stopping() noexcept;
/// @param status  one line for `systemctl status`
void notify_status(const char* status) noexcept;

}  // namespace maplet::daemon
