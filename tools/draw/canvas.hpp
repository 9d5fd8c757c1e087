// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tools/draw/contour.hpp"

typedef struct _cairo cairo_t;                  // NOLINT: Cairo's own names
typedef struct _cairo_surface cairo_surface_t;  // NOLINT

namespace maplet::draw {

struct Colour {
  std::uint32_t rgb = 0;  ///< 0xRRGGBB
  double alpha = 1.0;
};

enum class Weight : std::uint8_t { kRegular, kBold };
enum class Align : std::uint8_t { kLeft, kCentre, kRight };

struct TextStyle {
  double size_px = 16.0;
  Weight weight = Weight::kRegular;
  Colour colour{};
  Align align = Align::kLeft;
};

struct Pen {
  double width_px = 1.0;
  Colour colour{};
  double dash_px = 0.0;  ///< 0: solid
  bool round = true;     ///< ends and corners
};

/// A page of pixels, y down, that is written as SVG or PNG. The letters of an SVG are outlines: it
/// looks the same without our font.
///
/// Threads  one.
class Canvas {
 public:
  enum class Format : std::uint8_t { kSvg, kPng };
  Canvas(Format format, int width_px, int height_px);
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  void fill_page(Colour colour);
  /// One shape of several closed outlines, even-odd.
  void fill(std::span<const Polyline> outlines, Colour colour);
  void stroke(const Polyline& line, const Pen& pen);
  /// Closed.
  void stroke_outline(const Polyline& line, const Pen& pen);
  void disc(const Eigen::Vector2d& centre, double radius_px, Colour colour);
  void text(const Eigen::Vector2d& baseline, std::string_view words, const TextStyle& style);
  [[nodiscard]] double text_width(std::string_view words, const TextStyle& style);
  /// Draws only inside the box until unclip().
  void clip(const Bounds& box);
  void unclip();

  /// @throws std::runtime_error  naming the file, when it cannot be written
  void write(const std::filesystem::path& file);

 private:
  void trace(const Polyline& line);
  void use(Colour colour);
  void use(const TextStyle& style);
  void ink(const Pen& pen);

  struct Close {
    void operator()(cairo_surface_t* surface) const noexcept;
    void operator()(cairo_t* context) const noexcept;
  };
  Format format_;
  std::string svg_;
  std::unique_ptr<cairo_surface_t, Close> surface_;
  std::unique_ptr<cairo_t, Close> context_;
};

}  // namespace maplet::draw
