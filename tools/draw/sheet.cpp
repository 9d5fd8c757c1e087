// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/sheet.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include "tools/draw/canvas.hpp"
#include "tools/draw/layers.hpp"
#include "tools/draw/palette.hpp"

namespace maplet::draw {
namespace {

using Eigen::Vector2d;

constexpr int kWidth_px = 1600;
constexpr double kMargin_px = 56.0;
constexpr double kHeader_px = 132.0;
constexpr double kFooter_px = 112.0;
constexpr double kMinMap_px = 480.0;
constexpr double kMaxMap_px = 1060.0;
constexpr double kAir_m = 0.25;         // around the map
constexpr double kScaleBar_px = 300.0;  // at most
constexpr double kMaxScale = 260.0;     // px per m: a single desk does not fill the page

/// Where the map goes on the page, and how tall the page is.
struct Layout {
  Projection project;
  Bounds map_px;
  int height_px;
};

[[nodiscard]] Layout lay_out(const Bounds& bounds) {
  const Vector2d size_m = bounds.size() + Vector2d::Constant(2.0 * kAir_m);
  const double room_px = kWidth_px - 2.0 * kMargin_px;
  const double scale = std::min({room_px / size_m.x(), kMaxMap_px / size_m.y(), kMaxScale});
  const double tall_px = std::max(size_m.y() * scale, kMinMap_px);
  Layout layout;
  layout.map_px.low = {kMargin_px, kHeader_px};
  layout.map_px.high = {kWidth_px - kMargin_px, kHeader_px + tall_px};
  const Vector2d middle_m = 0.5 * (bounds.low + bounds.high);
  layout.project.px_per_m = scale;
  layout.project.origin_px = 0.5 * (layout.map_px.low + layout.map_px.high) -
                             scale * Vector2d{middle_m.x(), -middle_m.y()};
  layout.height_px = static_cast<int>(std::ceil(kHeader_px + tall_px + kFooter_px));
  return layout;
}

[[nodiscard]] std::string bytes_text(double bytes) {
  if (bytes < 1e3) return fmt::format("{:.0f} B", bytes);
  if (bytes < 1e4) return fmt::format("{:.1f} kB", bytes / 1e3);
  if (bytes < 1e6) return fmt::format("{:.0f} kB", bytes / 1e3);
  if (bytes < 1e7) return fmt::format("{:.1f} MB", bytes / 1e6);
  return fmt::format("{:.0f} MB", bytes / 1e6);
}

[[nodiscard]] std::string grouped(double number) {
  const std::string digits = fmt::format("{:.0f}", number);
  std::string out;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) out += ',';
    out += digits[i];
  }
  return out;
}

[[nodiscard]] std::string counted(std::size_t count, const char* one, const char* many) {
  return fmt::format("{} {}", grouped(static_cast<double>(count)), count == 1 ? one : many);
}

/// One entry: a sample and its words.
struct Entry {
  std::string words;
  double sample_px;
  std::function<void(Canvas&, const Vector2d& left_middle)> draw;
};

[[nodiscard]] Entry line_entry(const std::string& words, Pen pen) {
  static constexpr double kLong_px = 34.0;
  return {words, kLong_px, [pen](Canvas& canvas, const Vector2d& at) {
            canvas.stroke({at, at + Vector2d{kLong_px, 0.0}}, pen);
          }};
}

[[nodiscard]] Entry area_entry(const char* words, Colour fill, Colour edge) {
  static constexpr double kWide_px = 26.0;
  return {words, kWide_px, [=](Canvas& canvas, const Vector2d& at) {
            const Polyline box{at + Vector2d{0, -9}, at + Vector2d{kWide_px, -9},
                               at + Vector2d{kWide_px, 9}, at + Vector2d{0, 9}};
            canvas.fill(std::span{&box, 1}, fill);
            canvas.stroke_outline(box, {1.0, edge});
          }};
}

/// One box in three shades.
[[nodiscard]] Entry walls_entry() {
  static constexpr double kShade_px = 14.0;
  return {fmt::format("upright: over {:g}, {:g}, {:g} m seen", kWallHeights_m[0], kWallHeights_m[1],
                      kWallHeights_m[2]),
          3.0 * kShade_px, [](Canvas& canvas, const Vector2d& at) {
            for (std::size_t i = 0; i < kWalls.size(); ++i) {
              const double left_px = at.x() + static_cast<double>(i) * kShade_px;
              const double right_px = left_px + kShade_px;
              const Polyline box{{left_px, at.y() - 9.0},
                                 {right_px, at.y() - 9.0},
                                 {right_px, at.y() + 9.0},
                                 {left_px, at.y() + 9.0}};
              canvas.fill(std::span{&box, 1}, kWalls[i]);
            }
          }};
}

[[nodiscard]] Entry origin_entry(const char* words) {
  return {words, 2.0 * kOriginRadius_px, [](Canvas& canvas, const Vector2d& at) {
            draw_origin(canvas, at + Vector2d{kOriginRadius_px, 0.0}, "0", agent_colour(0));
          }};
}

/// What the picture holds, in the order of the reader's interest.
[[nodiscard]] std::vector<Entry> legend(const Plan& plan, double px_per_m) {
  const LineWidths widths = widths_at(px_per_m);
  const auto any = [&](auto has) { return std::ranges::any_of(plan.agents, has); };
  std::vector<Entry> out;
  if (!plan.walls[0].empty()) out.push_back(walls_entry());
  if (!plan.floor.empty()) out.push_back(area_entry("floor", kFloor, kHairline));
  if (!plan.tops.empty()) out.push_back(area_entry("table, shelf", kTops, kTopsEdge));
  for (std::size_t i = 0; i < plan.agents.size(); ++i) {
    if (plan.agents[i].trajectory.empty()) continue;
    const std::string words =
        plan.agents.size() == 1 ? "path" : fmt::format("path of {}", plan.agents[i].name);
    out.push_back(line_entry(words, {widths.path_px, agent_colour(i)}));
  }
  if (any([](const AgentPlan& a) { return !a.odometry.empty(); })) {
    out.push_back(line_entry("odometry alone", {widths.thin_px + 0.8, kOdometry}));
  }
  if (any([](const AgentPlan& a) { return !a.origins.empty(); })) {
    out.push_back(origin_entry("maplet"));
  }
  if (any([](const AgentPlan& a) { return !a.edges.empty(); })) {
    out.push_back(line_entry("delta-pose", {widths.thin_px, kInk}));
  }
  if (plan.counts.closures > 0) {
    out.push_back(line_entry("loop closure", {widths.thin_px + 0.8, kClosure, 6.0}));
  }
  return out;
}

void draw_scale_bar(Canvas& canvas, const Vector2d& right_px, double px_per_m) {
  const double length_m = scale_bar_m(kScaleBar_px / px_per_m);
  const Vector2d left_px = right_px - Vector2d{length_m * px_per_m, 0.0};
  const Vector2d tick{0.0, 7.0};
  canvas.stroke({left_px - tick, left_px, right_px, right_px - tick}, {2.0, kInk, 0.0, false});
  canvas.text(0.5 * (left_px + right_px) - Vector2d{0.0, 9.0}, fmt::format("{:g} m", length_m),
              {17.0, Weight::kBold, kInk, Align::kCentre});
}

/// In rows between the margin and `right_px`.
void draw_legend(Canvas& canvas, const Plan& plan, double px_per_m, double middle_px,
                 double right_px) {
  constexpr double kGap_px = 9.0;
  constexpr double kRow_px = 32.0;
  constexpr TextStyle kWords{17.0, Weight::kRegular, kSoftInk, Align::kLeft};
  Vector2d at{kMargin_px, middle_px};
  for (const Entry& entry : legend(plan, px_per_m)) {
    const double wide_px = entry.sample_px + kGap_px + canvas.text_width(entry.words, kWords);
    if (at.x() > kMargin_px && at.x() + wide_px > right_px) at = {kMargin_px, at.y() + kRow_px};
    entry.draw(canvas, at);
    canvas.text(at + Vector2d{entry.sample_px + kGap_px, 6.0}, entry.words, kWords);
    at.x() += wide_px + 24.0;
  }
}

void draw_all(Canvas& canvas, const Plan& plan, const std::string& title, const Layout& layout) {
  canvas.fill_page(kPaper);
  canvas.clip(layout.map_px);
  draw_floor(canvas, layout.project, plan);
  draw_walls(canvas, layout.project, plan);
  draw_paths(canvas, layout.project, plan);
  draw_skeleton(canvas, layout.project, plan);
  canvas.unclip();

  canvas.text({kMargin_px, 62.0}, title, {36.0, Weight::kBold, kInk, Align::kLeft});
  canvas.text({kMargin_px, 98.0}, figures(plan.counts),
              {20.0, Weight::kRegular, kSoftInk, Align::kLeft});
  const double rule_px = layout.map_px.high.y() + 28.0;
  canvas.stroke({{kMargin_px, rule_px}, {kWidth_px - kMargin_px, rule_px}}, {1.0, kHairline});
  const double px_per_m = layout.project.px_per_m;
  const double bar_px = scale_bar_m(kScaleBar_px / px_per_m) * px_per_m;
  draw_legend(canvas, plan, px_per_m, rule_px + 36.0, kWidth_px - kMargin_px - bar_px - 30.0);
  draw_scale_bar(canvas, {kWidth_px - kMargin_px, rule_px + 48.0}, px_per_m);
}

}  // namespace

double scale_bar_m(double longest_m) {
  const double decade = std::pow(10.0, std::floor(std::log10(longest_m)));
  for (const double step : {5.0, 2.0}) {
    if (step * decade <= longest_m) return step * decade;
  }
  return decade;
}

std::string figures(const PlanCounts& counts) {
  std::string out = counted(counts.frames, "frame", "frames");
  if (counts.path_m > 0.0) out += fmt::format("   ·   {:.1f} m", counts.path_m);
  out += fmt::format("   ·   {}", counted(counts.maplets, "maplet", "maplets"));
  if (counts.maplet_bytes) out += fmt::format(" in {}", bytes_text(*counts.maplet_bytes));
  if (counts.maplet_bytes && counts.point_cloud_bytes && *counts.maplet_bytes > 0.0) {
    out += fmt::format(", {} times less than the {} of points they stand for",
                       grouped(*counts.point_cloud_bytes / *counts.maplet_bytes),
                       bytes_text(*counts.point_cloud_bytes));
  }
  if (counts.closures > 0) {
    out += fmt::format("   ·   {}", counted(counts.closures, "loop closure", "loop closures"));
  }
  return out;
}

void draw_sheet(const Plan& plan, const std::string& title, const std::filesystem::path& file) {
  const bool svg = file.extension() == ".svg";
  if (!svg && file.extension() != ".png") {
    throw std::runtime_error{
        fmt::format("{}: give a name that ends in .svg or .png", file.string())};
  }
  const Layout layout = lay_out(plan.bounds);
  Canvas canvas{svg ? Canvas::Format::kSvg : Canvas::Format::kPng, kWidth_px, layout.height_px};
  draw_all(canvas, plan, title, layout);
  canvas.write(file);
}

}  // namespace maplet::draw
