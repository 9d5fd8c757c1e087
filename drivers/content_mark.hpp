// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

namespace maplet {

/// A checksum of what a finite source will deliver, wherever it lies: of a recording's lists and
/// camera.toml (the stamps of its images), of both ends of an .oni file, of a simulator's URI; with
/// the URI's parameters. Cheap: reads no image. docs/adr/0001
///
/// @return CRC-32C; of a source that cannot be read, that of its URI
[[nodiscard]] std::uint32_t content_mark(std::string_view uri);

}  // namespace maplet
