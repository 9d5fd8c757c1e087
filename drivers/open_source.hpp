// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "drivers/source.hpp"

namespace maplet {

/// Opens the source that a URI names: `tum:DIR[?first=N&count=M&every=K]`, `openni2:`,
/// `openni2:DEVICE-URI`, `openni2:FILE.oni`, `sim:WORLD[?key=value&...]`.
///
/// @return the source, or why not: kAbsent when a device may still come, kUsage for a URI that
/// makes
///   no sense, kBad for everything that stays wrong
[[nodiscard]] OpenedSource open_source(std::string_view uri, const SourceOptions& options);

/// Whether the URI names a scheme that there is; opens nothing.
/// @return one line that says what is wrong with it
[[nodiscard]] tl::expected<void, std::string> check_source(std::string_view uri);

}  // namespace maplet
