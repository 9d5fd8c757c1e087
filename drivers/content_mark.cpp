// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/content_mark.hpp"

#include <filesystem>
#include <fstream>
#include <string>

#include "core/base/crc.hpp"
#include "drivers/uri.hpp"

namespace maplet {

namespace {

namespace fs = std::filesystem;

/// A file's first and last `most` bytes and its size; nothing of what is no readable file.
void append_file(std::string& all, const fs::path& path, std::uintmax_t most) {
  std::error_code error;
  const std::uintmax_t size = fs::is_regular_file(path, error) ? fs::file_size(path, error) : 0;
  if (error || size == 0) return;
  all += path.filename().string() + ' ' + std::to_string(size) + '\n';
  std::ifstream file{path, std::ios::binary};
  std::string part(static_cast<std::size_t>(std::min(size, most)), '\0');
  for (const auto from : {std::uintmax_t{0}, size - part.size()}) {
    file.seekg(static_cast<std::streamoff>(from));
    if (file.read(part.data(), static_cast<std::streamsize>(part.size()))) all += part;
    if (part.size() == size) break;
  }
}

}  // namespace

std::uint32_t content_mark(std::string_view text) {
  std::string all{text};
  if (const auto uri = Uri::parse(text)) {
    constexpr std::uintmax_t kWhole = std::uintmax_t{64} << 20;
    std::string content;
    if (uri->scheme == "tum") {
      for (const char* name : {"camera.toml", "depth.txt", "rgb.txt", "odometry.txt", "gyro.txt"}) {
        append_file(content, fs::path{uri->path} / name, kWhole);
      }
    } else if (uri->path.ends_with(".oni")) {
      append_file(content, uri->path, std::uintmax_t{64} << 10);
    }
    if (!content.empty()) {
      all = uri->scheme + '\n' + content;
      for (const auto& [key, value] : uri->parameters) all += key + '=' + value + '\n';
    }
  }
  return crc32c(std::as_bytes(std::span{all}));
}

}  // namespace maplet
