// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/uri.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>

#include "drivers/line.hpp"

namespace maplet {

namespace {

using Problem = tl::unexpected<std::string>;

constexpr std::size_t kMaxUriBytes = 8192;

bool is_letter(char c) noexcept { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

/// Of the part behind the scheme. @return nothing when a % is not followed by two hex digits, or
/// when a control character comes out (no path or value holds one, every error stays one line)
std::optional<std::string> decode(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned char c = static_cast<unsigned char>(text[i]);
    if (c == '%') {
      if (text.size() - i < 3) return {};
      const char* digits = text.data() + i + 1;
      if (std::from_chars(digits, digits + 2, c, 16).ptr != digits + 2) return {};
      i += 2;
    }
    if (c < 0x20 || c == 0x7f) return {};
    out.push_back(static_cast<char>(c));
  }
  return out;
}

/// For messages: a hostile URI must not flood the terminal either.
std::string printable(std::string_view text) {
  constexpr std::size_t kShown = 200;
  std::string out = one_line(std::string{text.substr(0, kShown)});
  if (text.size() > kShown) out.append("...");
  return out;
}

}  // namespace

tl::expected<Uri, std::string> Uri::parse(std::string_view text) {
  if (text.size() > kMaxUriBytes) {
    return Problem{fmt::format("source URI is longer than {} bytes", kMaxUriBytes)};
  }
  const std::string shown = printable(text);
  const std::size_t colon = text.find(':');
  const std::string_view scheme = text.substr(0, colon);
  const auto fits = [](char c) { return is_letter(c) || (c >= '0' && c <= '9'); };
  if (colon == std::string_view::npos || scheme.empty() || !is_letter(scheme[0]) ||
      !std::all_of(scheme.begin(), scheme.end(), fits)) {
    return Problem{
        fmt::format("source '{}' is not a URI: write SCHEME:PATH[?key=value&...], for "
                    "example tum:DIR",
                    shown)};
  }
  Uri uri;
  uri.scheme = scheme;
  for (char& c : uri.scheme) c = static_cast<char>(c | 0x20);  // letters to lower case

  const std::string_view rest = text.substr(colon + 1);
  const std::size_t mark = rest.find('?');
  const auto path = decode(rest.substr(0, mark));
  if (!path) {
    return Problem{
        fmt::format("source '{}': a path holds no control characters, and % as %25", shown)};
  }
  uri.path = *path;
  std::string_view query = mark == std::string_view::npos ? "" : rest.substr(mark + 1);
  while (!query.empty()) {
    const std::string_view pair = query.substr(0, query.find('&'));
    query.remove_prefix(std::min(query.size(), pair.size() + 1));
    const std::size_t equals = pair.find('=');
    const auto key = decode(pair.substr(0, equals));
    const auto value = decode(equals == std::string_view::npos ? "" : pair.substr(equals + 1));
    if (equals == std::string_view::npos || !key || key->empty() || !value) {
      return Problem{fmt::format("source '{}': '{}' is not key=value", shown, printable(pair))};
    }
    if (!uri.parameters.emplace(*key, *value).second) {
      return Problem{fmt::format("source '{}': {} is given twice", shown, *key)};
    }
  }
  return uri;
}

tl::expected<void, std::string> Uri::only(std::initializer_list<std::string_view> known) const {
  for (const auto& [key, value] : parameters) {
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    if (known.size() == 0) {
      return Problem{fmt::format("{}: takes no parameters, got '{}'", scheme, key)};
    }
    return Problem{
        fmt::format("{}: no parameter '{}'; there are {}", scheme, key, fmt::join(known, ", "))};
  }
  return {};
}

tl::expected<std::uint64_t, std::string> Uri::count(std::string_view key, std::uint64_t fallback,
                                                    std::uint64_t min, std::uint64_t max) const {
  const auto found = parameters.find(std::string{key});
  if (found == parameters.end()) return fallback;
  const std::string& text = found->second;
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value < min || value > max) {
    return Problem{fmt::format("{}: {}={}: expected a whole number from {} to {}", scheme, key,
                               text, min, max)};
  }
  return value;
}

}  // namespace maplet
