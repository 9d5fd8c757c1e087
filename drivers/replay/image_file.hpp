// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string_view>
#include <tl/expected.hpp>

#include "core/base/expected.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/frame/image_size.hpp"
#include "drivers/line.hpp"

namespace maplet {

/// What is wrong with which image, in one line. Memory: no heap.
struct ImageError {
  ErrorCode code;  ///< kIo (cannot be read or written) or kBadInput
  Line what;
};

/// Reads PNG and JPEG images into buffers of the caller. Survives any bytes.
///
/// Memory   fixed at construction: room for the largest file and for libpng's work; libjpeg-turbo
///          allocates on its own. Sizes are checked against core/limits.hpp before anything grows.
/// Time     O(file bytes + pixels)
/// Threads  one caller at a time.
class ImageReader {
 public:
  ImageReader();
  ~ImageReader();
  ImageReader(ImageReader&&) noexcept;
  ImageReader& operator=(ImageReader&&) noexcept;

  template <class T>
  using Result = tl::expected<T, ImageError>;

  /// A 16-bit gray PNG.
  /// @param size    what the image must measure
  /// @param pixels  size.pixels() of them, row-major; undefined after an error
  [[nodiscard]] Result<void> read_depth(const std::filesystem::path& file, ImageSize size,
                                        std::span<std::uint16_t> pixels) noexcept;

  /// A PNG of any kind or a JPEG as 8-bit gray (luma of BT.601, as in JPEG).
  [[nodiscard]] Result<void> read_gray(const std::filesystem::path& file, ImageSize size,
                                       std::span<std::uint8_t> pixels) noexcept;

  /// What the header of a PNG or JPEG says.
  [[nodiscard]] Result<ImageSize> read_size(const std::filesystem::path& file) noexcept;

  /// The same from bytes in memory; `name` stands for the file in errors.
  [[nodiscard]] Result<void> decode_depth(std::span<const std::byte> bytes, std::string_view name,
                                          ImageSize size, std::span<std::uint16_t> pixels) noexcept;
  [[nodiscard]] Result<void> decode_gray(std::span<const std::byte> bytes, std::string_view name,
                                         ImageSize size, std::span<std::uint8_t> pixels) noexcept;
  [[nodiscard]] Result<ImageSize> decode_size(std::span<const std::byte> bytes,
                                              std::string_view name) noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Writes a 16-bit or 8-bit gray PNG; nothing is left behind after an error. Allocates.
[[nodiscard]] tl::expected<void, ImageError> write_png(const std::filesystem::path& file,
                                                       const ImageView<std::uint16_t>& image);
[[nodiscard]] tl::expected<void, ImageError> write_png(const std::filesystem::path& file,
                                                       const ImageView<std::uint8_t>& image);

}  // namespace maplet
