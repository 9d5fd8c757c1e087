// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/openni2/pixels.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <type_traits>

namespace maplet::openni2 {

namespace {

struct Rgb {
  std::uint8_t r, g, b;
};
static_assert(sizeof(Rgb) == 3);

/// The part of the image that a frame holds.
struct Part {
  const std::byte* first = nullptr;
  std::size_t stride_bytes = 0;
  int left_px = 0, top_px = 0, width_px = 0, height_px = 0;
};

/// @return nothing (first == nullptr) when it reaches beyond the image or beyond the frame's bytes
template <class Pixel>
Part part_of(const openni::VideoFrameRef& frame, const Layout& layout) noexcept {
  Part part{static_cast<const std::byte*>(frame.getData()),
            static_cast<std::size_t>(std::max(0, frame.getStrideInBytes())),
            0,
            0,
            frame.getWidth(),
            frame.getHeight()};
  if (frame.getCroppingEnabled()) {
    part.left_px = frame.getCropOriginX();
    part.top_px = frame.getCropOriginY();
  } else if (part.width_px != layout.width_px || part.height_px != layout.height_px) {
    return {};
  }
  const bool inside = part.width_px > 0 && part.height_px > 0 && part.left_px >= 0 &&
                      part.top_px >= 0 && part.width_px <= layout.width_px - part.left_px &&
                      part.height_px <= layout.height_px - part.top_px;
  if (!inside) return {};
  const std::size_t row_bytes = static_cast<std::size_t>(part.width_px) * sizeof(Pixel);
  const std::size_t needed =
      part.stride_bytes * static_cast<std::size_t>(part.height_px - 1) + row_bytes;
  const bool whole = part.stride_bytes >= row_bytes && frame.getDataSize() > 0 &&
                     needed <= static_cast<std::size_t>(frame.getDataSize());
  return whole ? part : Part{};
}

/// Row by row into the whole image; `convert` makes one pixel of ours from one of theirs.
template <class From, class To, class Convert>
bool copy(const openni::VideoFrameRef& frame, const Layout& layout, std::span<To> to,
          Convert convert) noexcept {
  const auto pixels =
      static_cast<std::size_t>(layout.width_px) * static_cast<std::size_t>(layout.height_px);
  const Part part = part_of<From>(frame, layout);
  if (part.first == nullptr || to.size() < pixels) return false;
  if (part.width_px != layout.width_px || part.height_px != layout.height_px) {
    std::fill_n(to.begin(), pixels, To{0});
  }
  for (int v = 0; v < part.height_px; ++v) {
    const std::byte* from = part.first + static_cast<std::size_t>(v) * part.stride_bytes;
    To* row = to.data() + static_cast<std::ptrdiff_t>(part.top_px + v) * layout.width_px;
    To* at = row + (layout.mirrored ? layout.width_px - 1 - part.left_px : part.left_px);
    const std::ptrdiff_t step = layout.mirrored ? -1 : 1;
    if constexpr (std::is_same_v<From, To>) {  // as it is
      if (!layout.mirrored) {
        std::memcpy(at, from, static_cast<std::size_t>(part.width_px) * sizeof(To));
        continue;
      }
    }
    for (int u = 0; u < part.width_px; ++u, at += step, from += sizeof(From)) {
      From pixel;
      std::memcpy(&pixel, from, sizeof pixel);
      *at = convert(pixel);
    }
  }
  return true;
}

}  // namespace

bool copy_depth(const openni::VideoFrameRef& frame, const Layout& layout,
                const InvalidValues& invalid, std::span<std::uint16_t> to) noexcept {
  if (!copy<std::uint16_t>(frame, layout, to, [](std::uint16_t depth) { return depth; })) {
    return false;
  }
  for (const std::uint16_t value : invalid)
    std::replace(to.begin(), to.end(), value, std::uint16_t{0});
  return true;
}

bool copy_gray(const openni::VideoFrameRef& frame, const Layout& layout,
               std::span<std::uint8_t> to) noexcept {
  switch (frame.getVideoMode().getPixelFormat()) {
    case openni::PIXEL_FORMAT_GRAY8:
      return copy<std::uint8_t>(frame, layout, to, [](std::uint8_t gray) { return gray; });
    case openni::PIXEL_FORMAT_RGB888:  // weights of 2^16
      return copy<Rgb>(frame, layout, to, [](Rgb c) {
        return static_cast<std::uint8_t>((19595 * c.r + 38470 * c.g + 7471 * c.b + 32768) >> 16);
      });
    default:
      return false;
  }
}

}  // namespace maplet::openni2
