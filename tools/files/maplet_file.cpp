// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/files/maplet_file.hpp"

#include <fmt/core.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "core/maplet/codec.hpp"

namespace maplet::files {

std::vector<std::byte> read_bytes(const std::filesystem::path& file) {
  if (std::filesystem::is_directory(file)) {
    throw std::runtime_error{
        fmt::format("{} is a folder: give one of its files (NNNN.maplet)", file.string())};
  }
  if (std::filesystem::exists(file) && !std::filesystem::is_regular_file(file)) {
    throw std::runtime_error{fmt::format("{} is no file: give a NNNN.maplet", file.string())};
  }
  std::ifstream in{file, std::ios::binary};
  std::vector<std::byte> bytes(kMaxMapletBytes + 1);
  if (in) {
    in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    bytes.resize(static_cast<std::size_t>(in.gcount()));
    if (bytes.size() > kMaxMapletBytes) {
      throw std::runtime_error{fmt::format("{} is no maplet: it has more than {} bytes",
                                           file.string(), kMaxMapletBytes)};
    }
    if (in.eof()) return bytes;
  }
  throw std::runtime_error{fmt::format("cannot read {}: {}", file.string(), std::strerror(errno))};
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
