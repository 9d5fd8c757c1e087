// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "daemon/config.hpp"

namespace maplet::daemon {

/// What is wrong, where, and what is allowed: one line.
using ConfigError = std::string;

/// Reads a TOML file over the defaults. Unknown keys, wrong types, values out of range (and NaN)
/// are errors that name file and line; nothing is repaired silently.
[[nodiscard]] tl::expected<Config, ConfigError> load_config(const std::string& path);

/// The same from text; `name` stands where the file's name would. Bytes from outside: has a fuzz
/// target.
[[nodiscard]] tl::expected<Config, ConfigError> parse_config(std::string_view text,
                                                             std::string_view name);

/// Applies one `key=value` of the command line, as TOML; a value that is no TOML is a string.
[[nodiscard]] tl::expected<void, ConfigError> set_key(Config& config, std::string_view assignment);

/// What the single keys' ranges cannot say. After the last set_key().
[[nodiscard]] tl::expected<void, ConfigError> check_together(const Config& config);

/// All keys with their values as a TOML file, each with its help and range: what --print-config
/// prints, and the source of the manual.
[[nodiscard]] std::string print_config(const Config& config);

}  // namespace maplet::daemon
