// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/text.hpp"
#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace maplet;
  const auto text = fuzz::text(data, size);
  if (const auto stamp = parse_stamp(text)) {
    fuzz::require(parse_stamp(format_stamp(*stamp)) == *stamp, "a stamp survives a round trip");
  }
  int line = 0;
  for (const ListedImage& image : parse_image_list(text)) {
    fuzz::require(image.line > line, "lines are in order");
    line = image.line;
    fuzz::require(image.stamp.has_value() == !image.file.empty(), "a stamp comes with a file");
    if (image.stamp) {
      fuzz::require(parse_stamp(format_stamp(*image.stamp)) == *image.stamp,
                    "a listed stamp survives a round trip");
    }
  }
  return 0;
}
