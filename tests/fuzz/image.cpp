// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <vector>

#include "core/limits.hpp"
#include "drivers/replay/image_file.hpp"
#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace maplet;
  static ImageReader reader;
  const auto bytes = fuzz::bytes(data, size);
  const auto found = reader.decode_size(bytes, "x.png");
  if (!found) {
    fuzz::require_one_line(view(found.error().what));
    return 0;
  }
  fuzz::require(found->width_px > 0 && found->width_px <= static_cast<int>(kMaxWidthPx) &&
                    found->height_px > 0 && found->height_px <= static_cast<int>(kMaxHeightPx),
                "sizes are within the limits");
  // On the heap and exact: a sanitizer sees a pixel too many.
  std::vector<std::uint16_t> depth(found->pixels());
  std::vector<std::uint8_t> gray(found->pixels());
  if (const auto read = reader.decode_depth(bytes, "x.png", *found, depth); !read) {
    fuzz::require_one_line(view(read.error().what));
  }
  if (const auto read = reader.decode_gray(bytes, "x.png", *found, gray); !read) {
    fuzz::require_one_line(view(read.error().what));
  }
  return 0;
}
