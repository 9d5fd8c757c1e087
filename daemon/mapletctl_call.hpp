// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace maplet::daemon {

/// Runs `mapletctl ARGUMENTS...`, the one beside this program or else the one on PATH, and waits.
///
/// Pictures and meshes are its work: the daemon links no drawing library.
/// @return an empty string, or what went wrong
[[nodiscard]] std::string call_mapletctl(const std::vector<std::string>& arguments);

}  // namespace maplet::daemon
