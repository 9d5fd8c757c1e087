// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "daemon/config.hpp"
#include "daemon/options.hpp"
#include "daemon/pacer.hpp"
#include "daemon/state_directory.hpp"
#include "drivers/open_source.hpp"

namespace maplet::daemon {

/// Recordings run as --pace says; a camera sets its own.
[[nodiscard]] Pace pace_of(const Options& options, const Config& config);

/// The number of this life of the agent. docs/adr/0001: that of a replay in fast pace is derived
/// from everything that decides its bytes; any other is random.
/// One that goes on with a journal has that one's.
[[nodiscard]] std::uint32_t epoch_of(const Options& options, const Config& config,
                                     const StateDirectory& state);

/// What a source needs of the configuration.
[[nodiscard]] SourceOptions source_options(const Config& config);

}  // namespace maplet::daemon
