// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

namespace maplet::daemon {

/// SIGTERM and SIGINT ask for the end. SIGHUP asks a service to read its configuration anew; a
/// finite run takes it as its terminal's farewell and ends.
void catch_signals(bool service);

/// Set by SIGTERM, SIGINT.
[[nodiscard]] const std::atomic<bool>& stop_asked() noexcept;

/// Set by SIGHUP. @return whether it was, once
[[nodiscard]] bool take_reload() noexcept;

}  // namespace maplet::daemon
