// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/libcamera/luma.hpp"

#include <algorithm>
#include <array>
#include <string_view>

namespace maplet::camera {

namespace {

constexpr std::uint32_t fourcc_of(std::string_view name) noexcept {
  std::uint32_t code = 0;
  for (std::size_t i = 4; i-- > 0;) {
    code = code << 8 | static_cast<std::uint8_t>(name[i]);
  }
  return code;
}

struct Known {
  std::uint32_t fourcc;
  LumaLayout layout;
};

constexpr std::array kKnown{
    Known{fourcc_of("NV12"), {0, 1}},
    Known{fourcc_of("NV21"), {0, 1}},
    Known{fourcc_of("NV16"), {0, 1}},
    Known{fourcc_of("NV61"), {0, 1}},
    Known{fourcc_of("NV24"), {0, 1}},
    Known{fourcc_of("NV42"), {0, 1}},
    Known{fourcc_of("YU12"), {0, 1}},
    Known{fourcc_of("YV12"), {0, 1}},
    Known{fourcc_of("YU16"), {0, 1}},
    Known{fourcc_of("YV16"), {0, 1}},
    Known{fourcc_of("YU24"), {0, 1}},
    Known{fourcc_of("YV24"), {0, 1}},
    Known{fourcc_of("R8  "), {0, 1}},
    Known{fourcc_of("YUYV"), {0, 2}},
    Known{fourcc_of("YVYU"), {0, 2}},
    Known{fourcc_of("UYVY"), {1, 2}},
    Known{fourcc_of("VYUY"), {1, 2}},
    Known{fourcc_of("BG24"), {0, 3, LumaLayout::Colours::kRgb}},
    Known{fourcc_of("RG24"), {0, 3, LumaLayout::Colours::kBgr}},
};

/// Luma of BT.601, weights of 2^16.
void mix(const std::uint8_t* from, LumaLayout::Colours order, std::span<std::uint8_t> to) noexcept {
  const std::size_t red = order == LumaLayout::Colours::kRgb ? 0 : 2;
  for (std::size_t u = 0; u < to.size(); ++u, from += 3) {
    const std::uint32_t sum = 19595U * from[red] + 38470U * from[1] + 7471U * from[2 - red];
    to[u] = static_cast<std::uint8_t>((sum + 32768U) >> 16);
  }
}

}  // namespace

std::optional<LumaLayout> luma_layout(std::uint32_t fourcc) noexcept {
  const auto* found = std::find_if(kKnown.begin(), kKnown.end(),
                                   [&](const Known& known) { return known.fourcc == fourcc; });
  if (found == kKnown.end()) return {};
  return found->layout;
}

bool copy_luma(const LumaImage& image, const LumaLayout& layout,
               std::span<std::uint8_t> to) noexcept {
  if (image.width_px <= 0 || image.height_px <= 0) return false;
  const auto width = static_cast<std::size_t>(image.width_px);
  const auto height = static_cast<std::size_t>(image.height_px);
  const bool mixes = layout.colours != LumaLayout::Colours::kNone;
  const std::size_t row_bytes = layout.first + layout.step * (width - 1) + (mixes ? 3 : 1);
  if (image.stride_bytes < row_bytes || to.size() < width * height) return false;
  if (image.plane.size() < image.stride_bytes * (height - 1) + row_bytes) return false;
  for (std::size_t v = 0; v < height; ++v) {
    const std::uint8_t* from = image.plane.data() + v * image.stride_bytes + layout.first;
    std::uint8_t* row = to.data() + v * width;
    if (mixes) {
      mix(from, layout.colours, {row, width});
    } else if (layout.step == 1) {
      std::copy_n(from, width, row);
    } else {
      for (std::size_t u = 0; u < width; ++u) row[u] = from[u * layout.step];
    }
  }
  return true;
}

}  // namespace maplet::camera
