// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/openni2/openni2_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "drivers/openni2/capture.hpp"

namespace maplet {

namespace {

using openni2::Capture;
using Kind = SourceError::Kind;
using Setup = tl::expected<void, SourceError>;

bool names_a_file(const std::string& where) {
  std::error_code ignored;
  return where.ends_with(".oni") || std::filesystem::is_regular_file(where, ignored);
}

/// The path as OpenNI2 wants it: absolute, for it changes the working directory.
tl::expected<std::string, SourceError> file_path(const std::string& where) {
  constexpr std::size_t kMaxPath = ONI_MAX_STR - 1;
  std::error_code error;
  const auto status = std::filesystem::status(where, error);
  if (!std::filesystem::is_regular_file(status)) {
    return source_error(
        Kind::kBad, fmt::format("openni2: {}: {}", where, error ? error.message() : "not a file"));
  }
  const std::string path = std::filesystem::absolute(where, error).string();
  if (path.size() > kMaxPath) {
    return source_error(Kind::kBad, fmt::format("openni2: {}: OpenNI2 takes paths of {} bytes at "
                                                "most: move it",
                                                path, kMaxPath));
  }
  return path;
}

/// The URI of the camera to open.
tl::expected<std::string, SourceError> find_camera(const std::string& where) {
  const auto there = openni2::camera_uris();
  const std::string wanted = where.empty() && !there.empty() ? there.front() : where;
  if (std::count(there.begin(), there.end(), wanted) > 1) {
    return source_error(Kind::kBad,
                        fmt::format("openni2: {} devices call themselves {}: which one would open "
                                    "is not known; disconnect all but one",
                                    std::count(there.begin(), there.end(), wanted), wanted));
  }
  if (where.empty() && !there.empty()) return there.front();
  if (!where.empty() && std::find(there.begin(), there.end(), where) != there.end()) return where;
  return source_error(
      Kind::kAbsent,
      where.empty()
          ? std::string{"no OpenNI2 device found: connect a camera; when one is "
                        "connected, let this user open it (udev rules)"}
          : fmt::format("no OpenNI2 device found at {}: connect it, or choose from: {}", where,
                        there.empty() ? "none" : fmt::format("{}", fmt::join(there, ", "))));
}

tl::unexpected<SourceError> no_runtime() {
  return source_error(Kind::kBad, fmt::format("OpenNI2 does not start: {}; install libopenni2-0",
                                              openni2::last_error()));
}

OpenedSource open_capture(std::string uri, bool file, const SourceOptions& options,
                          const std::string& record_to) {
  auto capture = std::make_unique<Capture>(std::move(uri), file, options);
  if (auto opened = capture->open(record_to); !opened) return tl::unexpected{opened.error()};
  return capture;
}

}  // namespace

OpenedSource open_openni2(const std::string& where, const SourceOptions& options) {
  const bool file = names_a_file(where);
  std::string uri;
  if (file) {
    auto path = file_path(where);
    if (!path) return tl::unexpected{path.error()};
    uri = std::move(*path);
  }
  if (!openni2::start_runtime()) {
    return no_runtime();
  }
  if (!file) {
    auto found = find_camera(where);
    if (!found) return tl::unexpected{found.error()};
    uri = std::move(*found);
  }
  return open_capture(std::move(uri), file, options, {});
}

OpenedSource record_openni2(const std::string& where, const std::string& file,
                            const SourceOptions& options) {
  if (names_a_file(where)) {
    return source_error(Kind::kUsage, fmt::format("openni2: {}: is a recording: name a camera, or "
                                                  "a folder to write to",
                                                  where));
  }
  std::error_code error;
  const std::string path = std::filesystem::absolute(file, error).string();
  if (!openni2::start_runtime()) return no_runtime();
  auto uri = find_camera(where);
  if (!uri) return tl::unexpected{uri.error()};
  return open_capture(std::move(*uri), false, options, path);
}

}  // namespace maplet
