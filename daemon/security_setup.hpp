// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "daemon/config.hpp"
#include "transport/security/key_folder.hpp"

namespace maplet::daemon {

/// What a secured agent starts with.
struct SecuritySetup {
  AgentKeys keys;
  std::vector<Bytes> kept;    ///< notices of the file where the newest is kept
  std::vector<Bytes> beside;  ///< notices beside the keys
  std::string kept_in;        ///< that file
  std::vector<std::string> said;

  /// After all of them.
  [[nodiscard]] KeyStanding standing() const;
};

/// Reads the keys that the configuration names. Their dates are looked at later: a clock may be set
/// while a service waits.
/// @param agent  whose they must be; nothing: anybody's
/// @param state  the folder of --state; empty: none
/// @return nothing where security is off; else the keys, or one line that says why not
[[nodiscard]] tl::expected<std::optional<SecuritySetup>, std::string> open_security(
    const Config& config, std::optional<std::uint16_t> agent, const std::string& state);

}  // namespace maplet::daemon
