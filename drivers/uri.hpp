// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <initializer_list>
#include <map>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

namespace maplet {

/// `SCHEME:path?key=value&key=value`, decoded: %XX stands for a byte everywhere behind the scheme
/// (%25 for a percent sign, %3F for a question mark in a path).
struct Uri {
  std::string scheme;  ///< lower case
  std::string path;    ///< may be empty
  std::map<std::string, std::string> parameters;

  /// @return the URI, or one line that says what is wrong with it
  [[nodiscard]] static tl::expected<Uri, std::string> parse(std::string_view text);

  /// @return an error that names the first parameter that is not one of `known`
  [[nodiscard]] tl::expected<void, std::string> only(
      std::initializer_list<std::string_view> known) const;

  /// A whole number within [min, max]; `fallback` when it is not given.
  [[nodiscard]] tl::expected<std::uint64_t, std::string> count(std::string_view key,
                                                               std::uint64_t fallback,
                                                               std::uint64_t min,
                                                               std::uint64_t max) const;
};

}  // namespace maplet
