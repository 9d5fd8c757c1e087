// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/canvas.hpp"

#include <cairo-svg.h>
#include <cairo.h>
#include <fmt/core.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <numbers>
#include <stdexcept>

namespace maplet::draw {
namespace {

constexpr const char* kFont = "Open Sans";  // fontconfig finds the nearest where it is missing

[[nodiscard]] cairo_status_t append(void* out, const unsigned char* bytes, unsigned count) {
  static_cast<std::string*>(out)->append(reinterpret_cast<const char*>(bytes), count);
  return CAIRO_STATUS_SUCCESS;
}

/// Cairo numbers the surfaces of a process; a picture must not depend on what was drawn before it.
void drop_surface_name(std::string& svg) {
  const auto name = svg.find(" id=\"surface");
  if (name != std::string::npos) svg.erase(name, svg.find('>', name) - name);
}

}  // namespace

void Canvas::Close::operator()(cairo_surface_t* surface) const noexcept {
  cairo_surface_destroy(surface);
}
void Canvas::Close::operator()(cairo_t* context) const noexcept { cairo_destroy(context); }

Canvas::Canvas(Format format, int width_px, int height_px) : format_{format} {
  if (format == Format::kSvg) {
    surface_.reset(cairo_svg_surface_create_for_stream(append, &svg_, width_px, height_px));
    cairo_svg_surface_set_document_unit(surface_.get(), CAIRO_SVG_UNIT_PX);
  } else {
    surface_.reset(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width_px, height_px));
  }
  context_.reset(cairo_create(surface_.get()));
}

Canvas::~Canvas() = default;

void Canvas::use(Colour colour) {
  const auto channel = [&](int shift) { return ((colour.rgb >> shift) & 0xFFU) / 255.0; };
  cairo_set_source_rgba(context_.get(), channel(16), channel(8), channel(0), colour.alpha);
}

void Canvas::use(const TextStyle& style) {
  cairo_select_font_face(
      context_.get(), kFont, CAIRO_FONT_SLANT_NORMAL,
      style.weight == Weight::kBold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context_.get(), style.size_px);
}

void Canvas::trace(const Polyline& line) {
  bool first = true;
  for (const Eigen::Vector2d& p : line) {
    first ? cairo_move_to(context_.get(), p.x(), p.y())
          : cairo_line_to(context_.get(), p.x(), p.y());
    first = false;
  }
}

void Canvas::ink(const Pen& pen) {
  use(pen.colour);
  cairo_set_line_width(context_.get(), pen.width_px);
  cairo_set_line_cap(context_.get(), pen.round ? CAIRO_LINE_CAP_ROUND : CAIRO_LINE_CAP_BUTT);
  cairo_set_line_join(context_.get(), pen.round ? CAIRO_LINE_JOIN_ROUND : CAIRO_LINE_JOIN_MITER);
  cairo_set_dash(context_.get(), &pen.dash_px, pen.dash_px > 0.0 ? 1 : 0, 0.0);
  cairo_stroke(context_.get());
}

void Canvas::fill_page(Colour colour) {
  use(colour);
  cairo_paint(context_.get());
}

void Canvas::fill(std::span<const Polyline> outlines, Colour colour) {
  for (const Polyline& line : outlines) {
    trace(line);
    cairo_close_path(context_.get());
  }
  use(colour);
  cairo_set_fill_rule(context_.get(), CAIRO_FILL_RULE_EVEN_ODD);
  cairo_fill(context_.get());
}

void Canvas::stroke(const Polyline& line, const Pen& pen) {
  trace(line);
  ink(pen);
}

void Canvas::stroke_outline(const Polyline& line, const Pen& pen) {
  trace(line);
  cairo_close_path(context_.get());
  ink(pen);
}

void Canvas::disc(const Eigen::Vector2d& centre, double radius_px, Colour colour) {
  cairo_new_sub_path(context_.get());
  cairo_arc(context_.get(), centre.x(), centre.y(), radius_px, 0.0, 2.0 * std::numbers::pi);
  use(colour);
  cairo_fill(context_.get());
}

double Canvas::text_width(std::string_view words, const TextStyle& style) {
  use(style);
  cairo_text_extents_t extents;
  cairo_text_extents(context_.get(), std::string{words}.c_str(), &extents);
  return extents.x_advance;
}

void Canvas::text(const Eigen::Vector2d& baseline, std::string_view words, const TextStyle& style) {
  const double width_px = text_width(words, style);
  const double back_px = style.align == Align::kLeft     ? 0.0
                         : style.align == Align::kCentre ? width_px / 2.0
                                                         : width_px;
  use(style.colour);
  cairo_move_to(context_.get(), baseline.x() - back_px, baseline.y());
  cairo_show_text(context_.get(), std::string{words}.c_str());
  cairo_new_path(context_.get());
}

void Canvas::clip(const Bounds& box) {
  cairo_save(context_.get());
  cairo_rectangle(context_.get(), box.low.x(), box.low.y(), box.size().x(), box.size().y());
  cairo_clip(context_.get());
}

void Canvas::unclip() { cairo_restore(context_.get()); }

void Canvas::write(const std::filesystem::path& file) {
  const auto check = [&](cairo_status_t status) {
    if (status == CAIRO_STATUS_SUCCESS) return;
    throw std::runtime_error{
        fmt::format("cannot write {}: {}", file.string(), cairo_status_to_string(status))};
  };
  check(cairo_status(context_.get()));
  if (format_ == Format::kPng) {
    check(cairo_surface_write_to_png(surface_.get(), file.c_str()));
    return;
  }
  cairo_surface_finish(surface_.get());
  check(cairo_surface_status(surface_.get()));
  drop_surface_name(svg_);
  std::ofstream out{file, std::ios::binary};
  out.write(svg_.data(), static_cast<std::streamsize>(svg_.size()));
  out.close();
  if (!out) {
    throw std::runtime_error{fmt::format("cannot write {}: {}; make room, or choose another folder",
                                         file.string(), std::strerror(errno))};
  }
}

}  // namespace maplet::draw
