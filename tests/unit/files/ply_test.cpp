// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/files/ply.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "tests/support/temp_dir.hpp"
#include "tools/files/maplet_file.hpp"

namespace maplet::files {
namespace {

Surface square() {
  return {{Eigen::Vector3d::UnitZ(), -1.0},
          1.0,
          -1.0F,
          {{Eigen::Vector3d{0, 0, 1}, Eigen::Vector3d{2, 0, 0}, Eigen::Vector3d{0, 1, 0}}}};
}

TEST(PlyMesh, WritesWhatItsHeaderSays) {
  PlyMesh mesh;
  mesh.add(square(), {10, 20, 30});
  mesh.add(square(), {1, 2, 3});
  const test::TempDir dir;
  const auto file = dir / "mesh.ply";
  mesh.write(file);
  const auto bytes = read_bytes(file);
  const std::string text{reinterpret_cast<const char*>(bytes.data()), bytes.size()};

  const auto body = text.find("end_header\n") + std::strlen("end_header\n");
  const std::string header = text.substr(0, body);
  EXPECT_EQ(header.find("ply\nformat binary_little_endian 1.0\n"), 0u);
  EXPECT_NE(header.find("element vertex 8\n"), std::string::npos);
  EXPECT_NE(header.find("element face 2\n"), std::string::npos);
  constexpr std::size_t kVertex = 3 * sizeof(float) + 3;
  constexpr std::size_t kFace = 1 + 4 * sizeof(std::int32_t);
  ASSERT_EQ(text.size(), body + 8 * kVertex + 2 * kFace);

  float third[3];  // of the first quad: corner + along + across
  std::memcpy(third, text.data() + body + 2 * kVertex, sizeof third);
  EXPECT_EQ(third[0], 2.0F);
  EXPECT_EQ(third[1], 1.0F);
  EXPECT_EQ(third[2], 1.0F);
  EXPECT_EQ(text.substr(body + 12, 3), (std::string{"\x0a\x14\x1e"}));
  std::int32_t last = 0;
  std::memcpy(&last, text.data() + text.size() - sizeof last, sizeof last);
  EXPECT_EQ(last, 7);
}

TEST(PlyMesh, SaysWhereItCannotWrite) {
  try {
    PlyMesh{}.write("/nowhere/map.ply");
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_STREQ(e.what(),
                 "cannot write /nowhere/map.ply: No such file or directory; make room, or choose "
                 "another folder");
  }
}

TEST(ColourOf, FollowsGrayAndMaplet) {
  Surface dark = square();
  dark.mean_gray = 10.0F;
  Surface bright = square();
  bright.mean_gray = 240.0F;
  EXPECT_LT(colour_of(0, dark).g, colour_of(0, bright).g);
  EXPECT_NE(colour_of(0, dark).r, colour_of(1, dark).r);
}

}  // namespace
}  // namespace maplet::files
