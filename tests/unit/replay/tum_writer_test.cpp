// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/tum_writer.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <vector>

#include "drivers/replay/tum_source.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet {
namespace {

using test::TempDir;

constexpr int kWidth = 40;
constexpr int kHeight = 30;

RecordedCamera camera() {
  RecordedCamera out;
  out.camera = {kWidth, kHeight, 35.25, -36.0, 19.5, 14.5};
  out.metres_per_unit = 0.0002;
  out.registered_to_colour = true;
  out.rate_hz = 30.0;
  return out;
}

struct Images {
  std::vector<std::uint16_t> depth;
  std::vector<std::uint8_t> gray;
  DepthFrame frame(std::int64_t stamp_us) {
    depth.resize(kWidth * kHeight);
    gray.resize(kWidth * kHeight);
    for (std::size_t i = 0; i < depth.size(); ++i) {
      depth[i] = static_cast<std::uint16_t>(i * 53 + static_cast<std::size_t>(stamp_us));
      gray[i] = static_cast<std::uint8_t>(i * 7 + static_cast<std::size_t>(stamp_us));
    }
    DepthFrame out;
    out.stamp = std::chrono::microseconds{stamp_us};
    out.depth = {depth.data(), kWidth, kHeight, kWidth};
    out.gray = {gray.data(), kWidth, kHeight, kWidth};
    return out;
  }
};

TEST(TumWriter, IsReadBackToThePixel) {
  const TempDir dir;
  auto writer = TumWriter::create(dir.path() / "out", camera(), "test");
  ASSERT_TRUE(writer) << writer.error();
  constexpr std::int64_t kStamps[] = {0, 33333, 1341836537655691};
  Images images;
  for (const std::int64_t stamp : kStamps) {
    ASSERT_TRUE(writer->write(images.frame(stamp)));
    ASSERT_TRUE(writer->write_pose(std::chrono::microseconds{stamp}, Se3{}));
  }
  ASSERT_TRUE(writer->finish());

  auto source = TumSource::open(dir.path() / "out", {}, {});
  ASSERT_TRUE(source) << source.error().what;
  for (const std::int64_t stamp : kStamps) {
    const DepthFrame truth = images.frame(stamp);
    const auto frame = (*source)->next(Deadline::never());
    ASSERT_TRUE(frame) << (*source)->detail();
    EXPECT_EQ(frame->stamp, truth.stamp);
    EXPECT_EQ(frame->metres_per_unit, 0.0002);
    EXPECT_EQ(frame->camera.fx_px, 35.25);
    EXPECT_EQ(frame->camera.fy_px, -36.0);
    ASSERT_FALSE(frame->gray.empty());
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        ASSERT_EQ(frame->depth.at(u, v), truth.depth.at(u, v));
        ASSERT_EQ(frame->gray.at(u, v), truth.gray.at(u, v));
      }
    }
  }
  EXPECT_FALSE((*source)->next(Deadline::never()));
}

TEST(TumWriter, ReplacesItsOwnRecordingButNoOther) {
  const TempDir dir;
  const auto own = dir.path() / "own";
  Images images;
  for (const int frames : {3, 1}) {
    auto writer = TumWriter::create(own, camera(), "test");
    ASSERT_TRUE(writer) << writer.error();
    for (int i = 0; i < frames; ++i) ASSERT_TRUE(writer->write(images.frame(i)));
    ASSERT_TRUE(writer->finish());
  }
  EXPECT_TRUE(std::filesystem::exists(own / "depth/000000.png"));
  EXPECT_FALSE(std::filesystem::exists(own / "depth/000002.png"));

  const auto real = dir.path() / "real";
  std::filesystem::create_directories(real / "depth");
  std::ofstream{real / "depth.txt"} << "# somebody's recording\n";
  const auto refused = TumWriter::create(real, camera(), "test");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().find(real.string()), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(real / "depth"));
}

TEST(TumWriter, NamesTheFolderThatCannotBeMade) {
  const TempDir dir;
  std::ofstream{dir.path() / "file"} << "in the way";
  const auto refused = TumWriter::create(dir.path() / "file" / "out", camera(), "test");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().find("file"), std::string::npos);
  EXPECT_EQ(refused.error().find('\n'), std::string::npos);
}

}  // namespace
}  // namespace maplet
