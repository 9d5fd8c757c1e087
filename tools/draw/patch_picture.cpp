// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/patch_picture.hpp"

#include <cairo/cairo.h>
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>

namespace maplet::draw {

namespace {

struct Rgb {
  double r, g, b;
};

/// Neighbouring numbers get hues far apart: steps of the golden angle.
Rgb plane_colour(unsigned index) {
  const double hue = std::fmod(static_cast<double>(index) * 0.6180339887 + 0.58, 1.0) * 6.0;
  const double value = 0.95 - 0.12 * static_cast<double>(index / 7 % 3);
  const double saturation = 0.75 - 0.2 * static_cast<double>(index / 3 % 2);
  const auto channel = [&](double n) {
    const double k = std::fmod(n + hue, 6.0);
    return value - value * saturation * std::clamp(std::min(k, 4.0 - k), 0.0, 1.0);
  };
  return {channel(5.0), channel(3.0), channel(1.0)};
}

/// What lies under the colours: the gray image, or near = bright.
double shade(const DepthFrame& frame, int u, int v) {
  if (!frame.gray.empty()) return 0.15 + 0.85 * frame.gray.at(u, v) / 255.0;
  const double z = frame.depth.at(u, v) * frame.metres_per_unit;
  return z > 0.0 ? 0.25 + 0.7 / (1.0 + 0.45 * z) : 0.0;
}

using Surface = std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)>;
using Context = std::unique_ptr<cairo_t, decltype(&cairo_destroy)>;

constexpr int kCaptionPx = 26;

void paint_pixels(cairo_surface_t* surface, const DepthFrame& frame,
                  std::span<const std::uint16_t> labels, int scale) {
  cairo_surface_flush(surface);
  unsigned char* data = cairo_image_surface_get_data(surface);
  const int stride = cairo_image_surface_get_stride(surface);
  const int width = frame.depth.width_px;
  for (int y = 0; y < frame.depth.height_px * scale; ++y) {
    auto* row = reinterpret_cast<std::uint32_t*>(data + y * stride);
    for (int x = 0; x < width * scale; ++x) {
      const int u = x / scale;
      const int v = y / scale;
      const double gray = shade(frame, u, v);
      const auto at = [&](int a, int b) { return labels[static_cast<std::size_t>(b * width + a)]; };
      Rgb c{gray * 0.45, gray * 0.45, gray * 0.45};
      if (const std::uint16_t label = at(u, v); label != 0) {
        c = plane_colour(label - 1U);
        const double light = 0.35 + 0.65 * gray;
        c = {c.r * light, c.g * light, c.b * light};
        if ((u + 1 < width && at(u + 1, v) != label) ||
            (v + 1 < frame.depth.height_px && at(u, v + 1) != label)) {
          c = {c.r * 0.35, c.g * 0.35, c.b * 0.35};
        }
      }
      const auto byte = [](double value) { return static_cast<std::uint32_t>(value * 255.0); };
      row[x] = byte(c.r) << 16 | byte(c.g) << 8 | byte(c.b);
    }
  }
  cairo_surface_mark_dirty(surface);
}

}  // namespace

void draw_patches(const std::filesystem::path& file, const DepthFrame& frame, const PatchSet& set,
                  std::span<const std::uint16_t> labels, const std::string& caption) {
  const int scale = frame.depth.width_px < 480 ? 2 : 1;
  const int width = frame.depth.width_px * scale;
  const int height = frame.depth.height_px * scale;
  const Surface surface{cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height + kCaptionPx),
                        cairo_surface_destroy};
  paint_pixels(surface.get(), frame, labels, scale);
  const Context cr{cairo_create(surface.get()), cairo_destroy};
  cairo_set_line_width(cr.get(), 1.0);
  for (const Patch& patch : set.patches) {
    cairo_set_source_rgba(cr.get(), 1.0, 1.0, 1.0, patch.plane == Patch::kNoPlane ? 0.5 : 0.16);
    cairo_rectangle(cr.get(), patch.u_px * scale + 0.5, patch.v_px * scale + 0.5,
                    patch.width_px * scale, patch.height_px * scale);
    cairo_stroke(cr.get());
  }
  cairo_set_source_rgb(cr.get(), 0.1, 0.1, 0.12);
  cairo_rectangle(cr.get(), 0, height, width, kCaptionPx);
  cairo_fill(cr.get());
  cairo_set_source_rgb(cr.get(), 0.92, 0.92, 0.92);
  cairo_select_font_face(cr.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(cr.get(), 13.0);
  cairo_move_to(cr.get(), 8.0, height + 18.0);
  cairo_show_text(cr.get(), caption.c_str());
  if (cairo_surface_write_to_png(surface.get(), file.c_str()) != CAIRO_STATUS_SUCCESS) {
    throw std::runtime_error{fmt::format("{}: cannot be written; is there space?", file.string())};
  }
}

}  // namespace maplet::draw
