// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tl/expected.hpp>

#include "daemon/config_io.hpp"
#include "daemon/options.hpp"

namespace maplet::daemon {

/// The configuration as the command line asks for it: the file, the keys set over it, the source.
/// Checked as a whole.
[[nodiscard]] tl::expected<Config, ConfigError> configure(const Options& options);

}  // namespace maplet::daemon
