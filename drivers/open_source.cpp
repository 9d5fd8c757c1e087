// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/open_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <limits>

#include "drivers/openni2/openni2_source.hpp"
#include "drivers/replay/tum_source.hpp"
#include "drivers/sim/sim_source.hpp"
#include "drivers/uri.hpp"

namespace maplet {

namespace {

using Kind = SourceError::Kind;

OpenedSource open_tum(const Uri& uri, const SourceOptions& options) {
  constexpr auto kMost = std::numeric_limits<std::uint64_t>::max();
  if (auto known = uri.only({"first", "count", "every"}); !known) {
    return source_error(Kind::kUsage, known.error());
  }
  if (uri.path.empty()) return source_error(Kind::kUsage, "tum: no folder: write tum:DIR");
  const auto first = uri.count("first", 0, 0, kMost);
  const auto count = uri.count("count", kMost, 1, kMost);
  const auto every = uri.count("every", 1, 1, kMost);
  for (const auto* number : {&first, &count, &every}) {
    if (!*number) return source_error(Kind::kUsage, number->error());
  }
  return TumSource::open(uri.path, {*first, *count, *every}, options);
}

OpenedSource open_simulator(const Uri& uri, const SourceOptions& options) {
  auto parameters = uri.parameters;
  if (!options.gray) parameters.insert_or_assign("gray", std::string{"0"});
  auto source = open_sim(uri.path, parameters);
  if (!source) return source_error(Kind::kUsage, source.error());
  if (options.noise_given) (*source)->say_noise(options.noise);
  return std::move(*source);
}

OpenedSource open_camera(const Uri& uri, const SourceOptions& options) {
  if (auto known = uri.only({}); !known) return source_error(Kind::kUsage, known.error());
  return open_openni2(uri.path, options);
}

/// mapletd replays what came besides frames, too: it opens the file itself.
OpenedSource open_record(const Uri& uri, const SourceOptions& /*options*/) {
  if (auto known = uri.only({}); !known) return source_error(Kind::kUsage, known.error());
  return source_error(Kind::kUsage, "record:" + uri.path + ": only mapletd --source replays it");
}

struct Scheme {
  std::string_view name;
  std::string_view usage;
  OpenedSource (*open)(const Uri& uri, const SourceOptions& options);
};

constexpr Scheme kSchemes[] = {
    {"openni2", "openni2:, openni2:DEVICE-URI, openni2:FILE.oni", open_camera},
    {"record", "record:FILE", open_record},
    {"sim", "sim:WORLD", open_simulator},
    {"tum", "tum:DIR", open_tum},
};

const Scheme* find_scheme(std::string_view name) {
  const auto* found = std::find_if(std::begin(kSchemes), std::end(kSchemes),
                                   [&](const Scheme& scheme) { return scheme.name == name; });
  return found == std::end(kSchemes) ? nullptr : found;
}

std::string no_such_scheme(std::string_view name) {
  std::string usages;
  for (const Scheme& scheme : kSchemes) {
    usages += usages.empty() ? "" : ", ";
    usages += scheme.usage;
  }
  return fmt::format("source '{}:': no such scheme; there are {}", name, usages);
}

}  // namespace

OpenedSource open_source(std::string_view text, const SourceOptions& options) {
  const auto uri = Uri::parse(text);
  if (!uri) return source_error(Kind::kUsage, uri.error());
  const Scheme* scheme = find_scheme(uri->scheme);
  if (scheme == nullptr) return source_error(Kind::kUsage, no_such_scheme(uri->scheme));
  return scheme->open(*uri, options);
}

tl::expected<void, std::string> check_source(std::string_view text) {
  const auto uri = Uri::parse(text);
  if (!uri) return tl::unexpected{uri.error()};
  if (find_scheme(uri->scheme) == nullptr) return tl::unexpected{no_such_scheme(uri->scheme)};
  if (uri->scheme == "record") {
    if (uri->path.empty()) return tl::unexpected{std::string{"record: no file: write record:FILE"}};
    return uri->only({});
  }
  return {};
}

}  // namespace maplet
