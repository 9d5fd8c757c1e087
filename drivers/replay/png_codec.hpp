// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <span>

/// libpng behind plain functions: its longjmp never leaves png_codec.cpp.
namespace maplet::png {

struct Header {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  int bits = 0;  ///< of a channel
  bool gray = false;
};

/// Why the last call failed: libpng's or our own words.
using Reason = std::array<char, 96>;

/// Storage that libpng and zlib work in while one image is read; starts over with each image.
class Pool {
 public:
  Pool();
  void reset() noexcept { used_ = 0; }
  [[nodiscard]] void* take(std::size_t bytes) noexcept;  ///< null when used up

 private:
  std::unique_ptr<std::byte[]> bytes_;
  std::size_t used_ = 0;
};

[[nodiscard]] bool is_png(std::span<const std::byte> bytes) noexcept;

[[nodiscard]] bool read_header(Pool& pool, std::span<const std::byte> bytes, Header& header,
                               Reason& why) noexcept;

/// The header must have been read and found fit: `pixels` holds width_px * height_px of them.
[[nodiscard]] bool read_depth(Pool& pool, std::span<const std::byte> bytes, std::uint16_t* pixels,
                              Reason& why) noexcept;
[[nodiscard]] bool read_gray(Pool& pool, std::span<const std::byte> bytes, std::uint8_t* pixels,
                             Reason& why) noexcept;

/// @param rows  top row first; samples in the machine's byte order
[[nodiscard]] bool write(std::FILE* file, int width_px, int height_px, int bits,
                         std::span<const std::byte* const> rows, Reason& why) noexcept;

}  // namespace maplet::png
