// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <tl/expected.hpp>

namespace maplet::daemon {

/// How a mission that is to end did.
enum class Cleared : std::uint8_t { kNow, kAtNextStart };

/// Removes the mission's files and what was imported: now, or at the next start where a daemon
/// works with them.
/// @return one line why not: there is none, or the folder does not let it go
[[nodiscard]] tl::expected<Cleared, std::string> clear_mission(const std::string& folder);

/// The next start removes the mission.
[[nodiscard]] bool clear_is_asked(const std::string& folder);

/// For who holds the folder's lock. @return one line what is left and why; empty: nothing
[[nodiscard]] std::string remove_mission(const std::string& folder);

}  // namespace maplet::daemon
