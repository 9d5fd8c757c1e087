// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "core/base/clock.hpp"

namespace maplet {

/// Seconds in decimal as nanoseconds, exactly: no double in between. Digits beyond the ninth are
/// rounded. Takes an exponent (1.305031102e+09: numpy writes so).
/// @return nothing when `text` is not a number or beyond +-146 years
[[nodiscard]] std::optional<Stamp> parse_stamp(std::string_view text) noexcept;

/// Seconds with six decimals, with nine when nanoseconds need them: what parse_stamp reads back.
[[nodiscard]] std::string format_stamp(Stamp stamp);

/// A line of depth.txt or rgb.txt.
struct ListedImage {
  int line = 0;                ///< from 1
  std::optional<Stamp> stamp;  ///< nothing: the line cannot be understood
  std::string file;            ///< relative to the list
};

/// Lines `stamp file`; # begins a comment, empty lines are skipped, what follows the file is
/// ignored.
[[nodiscard]] std::vector<ListedImage> parse_image_list(std::string_view text);

/// A small text file as a whole.
/// @return the text, or one line with the file's name and the reason
[[nodiscard]] tl::expected<std::string, std::string> read_text(const std::filesystem::path& file,
                                                               std::size_t max_bytes);

}  // namespace maplet
