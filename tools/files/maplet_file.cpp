// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/files/maplet_file.hpp"

#include <fmt/core.h>

#include <fstream>
#include <stdexcept>

#include "core/maplet/codec.hpp"

namespace maplet::files {

std::vector<std::byte> read_bytes(const std::filesystem::path& file) {
  if (std::filesystem::is_directory(file)) {
    throw std::runtime_error{
        fmt::format("{} is a folder: give one of its files (NNNN.maplet)", file.string())};
  }
  std::ifstream in{file, std::ios::binary};
  std::vector<std::byte> bytes;
  if (in) {
    for (char buffer[65536]; in.read(buffer, sizeof buffer), in.gcount() > 0;) {
      const auto* first = reinterpret_cast<const std::byte*>(buffer);
      bytes.insert(bytes.end(), first, first + in.gcount());
    }
    if (in.eof()) return bytes;
  }
  throw std::runtime_error{fmt::format("cannot read {}", file.string())};
}

std::unique_ptr<Maplet> read_maplet(const std::filesystem::path& file) {
  const std::vector<std::byte> bytes = read_bytes(file);
  auto out = std::make_unique<Maplet>();
  if (const auto decoded = decode(bytes, *out); !decoded) {
    throw std::runtime_error{fmt::format("{}: {}", file.string(), decoded.error().what)};
  }
  return out;
}

}  // namespace maplet::files
