// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "drivers/replay/tum_source.hpp"
#include "tests/unit/replay/images.hpp"

namespace maplet {

using test::view;
using test::write_bytes;

inline constexpr int kWidth = 8;
inline constexpr int kHeight = 6;

inline std::string camera_toml(std::string_view more) {
  return fmt::format(
      "[depth]\nwidth_px = {}\nheight_px = {}\nfx_px = 8.0\nfy_px = 8.0\ncx_px = 3.5\n"
      "cy_px = 2.5\nmetres_per_unit = 0.001\n{}\n",
      kWidth, kHeight, more);
}

/// A recording that a test writes and spoils.
class TumSourceTest : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(dir_ / "depth");
    std::filesystem::create_directory(dir_ / "rgb");
    write_bytes(dir_ / "camera.toml", camera_toml(""));
  }

  static std::string name(int i) { return fmt::format("depth/{}.png", i); }

  /// Frame i: all pixels 1000 + i, save an invalid 0, a 65535 and a 7.
  void write_depth(int i, int width = kWidth, int height = kHeight) {
    std::vector<std::uint16_t> pixels(static_cast<std::size_t>(width * height),
                                      static_cast<std::uint16_t>(1000 + i));
    pixels[0] = 0;
    pixels[1] = 65535;
    pixels[2] = 7;
    ASSERT_TRUE(write_png(dir_ / name(i), view(pixels, width)));
  }

  /// Frames at 0.0, 0.1, 0.2, ...
  void write_frames(int count) {
    std::string list = "# timestamp filename\n";
    for (int i = 0; i < count; ++i) {
      write_depth(i);
      list += fmt::format("{}.{} {}\n", i / 10, i % 10, name(i));
    }
    write_bytes(dir_ / "depth.txt", list);
  }

  void truncate(const std::string& file) {
    std::filesystem::resize_file(dir_ / file, std::filesystem::file_size(dir_ / file) / 2);
  }

  OpenedSource open(const TumSelection& selection = {}) {
    return TumSource::open(dir_.path(), selection, options_);
  }

  std::string error(const TumSelection& selection = {}) {
    auto opened = open(selection);
    if (opened) return "it opened";
    EXPECT_EQ(opened.error().kind, SourceError::Kind::kBad);
    EXPECT_EQ(opened.error().what.find('\n'), std::string::npos);
    return opened.error().what;
  }

  /// The values of the frames that come, by their middle pixel.
  static std::vector<int> play(DepthSource& source) {
    std::vector<int> values;
    for (auto frame = source.next(Deadline::never()); frame;
         frame = source.next(Deadline::never())) {
      values.push_back(frame->depth.at(4, 3) - 1000);
    }
    EXPECT_EQ(source.next(Deadline::never()).error().code, ErrorCode::kEnd);
    return values;
  }

  static bool says(const std::string& text, std::string_view part) {
    return text.find(part) != std::string::npos;
  }

  test::TempDir dir_;
  SourceOptions options_;
};

}  // namespace maplet
