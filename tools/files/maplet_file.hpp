// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <vector>

#include "core/maplet/maplet.hpp"

namespace maplet::files {

/// At most kMaxMapletBytes of them.
/// @throws std::runtime_error  naming the file, when it cannot be read or is larger
[[nodiscard]] std::vector<std::byte> read_bytes(const std::filesystem::path& file);

/// Decodes a `.maplet` file.
/// @throws std::runtime_error  naming the file, when it cannot be read or is no maplet
[[nodiscard]] std::unique_ptr<Maplet> read_maplet(const std::filesystem::path& file);

}  // namespace maplet::files
