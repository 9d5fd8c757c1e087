// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <png.h>
#include <turbojpeg.h>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/frame/depth_frame.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet::test {

template <class Pixel>
ImageView<Pixel> view(const std::vector<Pixel>& pixels, int width_px) {
  return {pixels.data(), width_px, static_cast<int>(pixels.size()) / width_px, width_px};
}

/// Writes 8-bit RGB as PNG: what colour cameras record.
inline void write_colour_png(const std::filesystem::path& file, int width_px, int height_px,
                             const std::vector<std::uint8_t>& rgb) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width_px);
  image.height = static_cast<png_uint_32>(height_px);
  image.format = PNG_FORMAT_RGB;
  if (!png_image_write_to_file(&image, file.c_str(), 0, rgb.data(), 0, nullptr)) {
    throw std::runtime_error(image.message);
  }
}

inline void write_jpeg(const std::filesystem::path& file, int width_px, int height_px,
                       const std::vector<std::uint8_t>& rgb) {
  tjhandle handle = tjInitCompress();
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  if (tjCompress2(handle, rgb.data(), width_px, 0, height_px, TJPF_RGB, &bytes, &size, TJSAMP_444,
                  95, 0) != 0) {
    throw std::runtime_error(tjGetErrorStr2(handle));
  }
  write_bytes(file, {reinterpret_cast<const char*>(bytes), size});
  tjFree(bytes);
  tjDestroy(handle);
}

}  // namespace maplet::test
