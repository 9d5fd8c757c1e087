// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/sheet.hpp"

#include <gtest/gtest.h>
#include <png.h>

#include <array>
#include <cstdio>
#include <set>
#include <string>

#include "tests/support/synthetic_run.hpp"
#include "tests/support/temp_dir.hpp"
#include "tools/draw/palette.hpp"

namespace maplet::draw {
namespace {

namespace fs = std::filesystem;

/// A PNG's size and how many pixels it has of each colour.
struct Image {
  unsigned width = 0, height = 0;
  std::map<std::uint32_t, int> pixels;
};

Image read_png(const fs::path& file) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_file(&image, file.c_str()), 0) << image.message;
  image.format = PNG_FORMAT_RGB;
  std::vector<png_byte> bytes(PNG_IMAGE_SIZE(image));
  EXPECT_NE(png_image_finish_read(&image, nullptr, bytes.data(), 0, nullptr), 0);
  Image out{image.width, image.height, {}};
  for (std::size_t i = 0; i + 2 < bytes.size(); i += 3) {
    ++out.pixels[(std::uint32_t{bytes[i]} << 16) | (std::uint32_t{bytes[i + 1]} << 8) |
                 bytes[i + 2]];
  }
  return out;
}

std::string read_text(const fs::path& file) { return test::read_bytes(file); }

class Sheet : public ::testing::Test {
 protected:
  void SetUp() override {
    test::write_synthetic_run(folder_, {.frames = 120, .maplets = 8, .tilt_rad = 0.3});
    run_ = files::read_run(folder_);
  }

  Plan plan() const { return make_plan(std::span{&run_, 1}, {}); }

  test::TempDir dir_;
  const fs::path folder_ = dir_ / "run";
  files::Run run_;
};

TEST_F(Sheet, PlanSeesTheFlatFromAbove) {
  const Plan p = plan();
  EXPECT_EQ(p.counts.frames, 120u);
  EXPECT_EQ(p.counts.maplets, 8u);
  EXPECT_EQ(p.counts.closures, 1u);
  EXPECT_NEAR(p.counts.path_m, 16.2, 0.3);
  EXPECT_GT(p.counts.floor_m2, 15.0);
  EXPECT_LT(p.counts.floor_m2, 9.0 * 6.5);
  EXPECT_NEAR(p.bounds.size().x() * p.bounds.size().y(), 9.0 * 6.5, 8.0);
  EXPECT_FALSE(p.tops.empty());
  // The flat's walls lie along the page and are a few squares thick: the highest outlines cover
  // little of the plan.
  ASSERT_FALSE(p.walls[2].empty());
  double length_m = 0.0;
  double along_m = 0.0;
  for (const Polyline& line : p.walls[2]) {
    for (std::size_t i = 0; i < line.size(); ++i) {
      const Eigen::Vector2d step = line[(i + 1) % line.size()] - line[i];
      length_m += step.norm();
      if (step.cwiseAbs().minCoeff() < 0.1 * step.norm()) along_m += step.norm();
    }
  }
  EXPECT_GT(length_m, 30.0);
  EXPECT_GT(along_m, 0.9 * length_m);
}

TEST_F(Sheet, UpCanBeGiven) {
  const Plan p = make_plan(std::span{&run_, 1}, Eigen::Vector3d{0, 0, -2.0});
  EXPECT_NE(p.bounds.size().y(), plan().bounds.size().y());
}

TEST_F(Sheet, DrawsEveryLayer) {
  const fs::path file = folder_ / "map.png";
  draw_sheet(plan(), "A flat", file);
  const Image image = read_png(file);
  EXPECT_EQ(image.width, 1600u);
  EXPECT_GT(image.height, 600u);
  for (const Colour colour : {kWalls[0], kWalls[1], kWalls[2], kFloor, kTops, kOdometry, kClosure,
                              agent_colour(0), kInk, kSoftInk}) {
    const auto found = image.pixels.find(colour.rgb);
    EXPECT_GT(found == image.pixels.end() ? 0 : found->second, 40) << std::hex << colour.rgb;
  }
}

TEST_F(Sheet, SvgNeedsNothingElse) {
  const fs::path file = folder_ / "map.svg";
  draw_sheet(plan(), "A flat", file);
  const std::string svg = read_text(file);
  EXPECT_NE(svg.find("<svg"), std::string::npos);
  EXPECT_EQ(svg.rfind("</svg>\n"), svg.size() - 7);
  for (const char* outside : {"<image", "<text", "font-family", "href=\"http", "url(http"}) {
    EXPECT_EQ(svg.find(outside), std::string::npos) << outside;
  }
  EXPECT_LT(svg.size(), 1'000'000u);
}

TEST_F(Sheet, IsTheSameEveryTime) {
  for (const char* name : {"map.svg", "map.png"}) {
    draw_sheet(plan(), "A flat", folder_ / name);
    const auto first = read_text(folder_ / name);
    draw_sheet(plan(), "A flat", folder_ / name);
    EXPECT_EQ(first, read_text(folder_ / name)) << name;
  }
}

TEST_F(Sheet, ShowsAgentsInTheirColours) {
  const std::array<files::Run, 2> runs{run_, run_};
  const Plan p = make_plan(runs, {});
  EXPECT_EQ(p.counts.maplets, 16u);
  draw_sheet(p, "Two", folder_ / "map.png");
  EXPECT_GT(read_png(folder_ / "map.png").pixels[agent_colour(1).rgb], 100);
}

TEST_F(Sheet, DrawsARunWithoutMaplets) {
  run_.maplets.clear();
  run_.nodes.clear();
  run_.edges.clear();
  run_.trajectory.resize(1);
  run_.odometry.clear();
  draw_sheet(plan(), "One pose", folder_ / "map.png");
  EXPECT_EQ(read_png(folder_ / "map.png").width, 1600u);
}

TEST_F(Sheet, SaysWhenThereIsNothingToDraw) {
  run_ = {};
  EXPECT_THROW((void)plan(), std::runtime_error);
}

TEST_F(Sheet, SaysWhatItCannotWrite) {
  for (const char* name : {"map.jpg", "missing/map.png", "missing/map.svg"}) {
    try {
      draw_sheet(plan(), "A flat", folder_ / name);
      FAIL() << name;
    } catch (const std::runtime_error& e) {
      EXPECT_NE(std::string{e.what()}.find(folder_.string()), std::string::npos) << e.what();
    }
  }
}

TEST(ScaleBar, IsARoundLength) {
  EXPECT_DOUBLE_EQ(scale_bar_m(7.0), 5.0);
  EXPECT_DOUBLE_EQ(scale_bar_m(4.99), 2.0);
  EXPECT_DOUBLE_EQ(scale_bar_m(1.7), 1.0);
  EXPECT_DOUBLE_EQ(scale_bar_m(0.3), 0.2);
  EXPECT_DOUBLE_EQ(scale_bar_m(120.0), 100.0);
}

TEST(Figures, ReadAsASentence) {
  PlanCounts counts{500, 12, 1, 3.98, 0.0, 38'400.0, 52.6e6};
  EXPECT_EQ(figures(counts),
            "500 frames   ·   4.0 m   ·   12 maplets in 38 kB, 1,370 times less than the 53 MB of "
            "points they stand for   ·   1 loop closure");
  EXPECT_EQ(figures({1, 1, 0, 0.0, 0.0, {}, {}}), "1 frame   ·   1 maplet");
}

}  // namespace
}  // namespace maplet::draw
