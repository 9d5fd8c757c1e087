// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "daemon/config.hpp"
#include "transport/security/key_files.hpp"

namespace maplet::daemon {

/// What a secured agent starts with.
struct SecuritySetup {
  AgentKeys keys;
  std::vector<Bytes> notices;  ///< that came after the keys
  std::string kept_in;         ///< the file where the newest notice is kept
};

/// Reads the keys that the configuration names. Their dates are looked at later: a clock may be set
/// while a service waits.
/// @param state  the folder of --state; empty: none
/// @return nothing where security is off; else the keys, or one line that says why not
[[nodiscard]] tl::expected<std::optional<SecuritySetup>, std::string> open_security(
    const Config& config, std::uint16_t agent, const std::string& state);

}  // namespace maplet::daemon
