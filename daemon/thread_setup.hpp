// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <thread>

namespace maplet::daemon {

/// Names the calling thread, and schedules it first-in first-out where `fifo_priority` is above 0.
/// @return why the kernel does not allow that, with the remedy, on one line
std::optional<std::string> set_up_this_thread(const char* name, int fifo_priority);

/// A thread that no signal goes to: those are main's.
[[nodiscard]] std::thread start_thread(const char* name, std::function<void()> body);

}  // namespace maplet::daemon
