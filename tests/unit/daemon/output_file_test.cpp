// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/output_file.hpp"

#include <gtest/gtest.h>

#include <cerrno>
#include <fstream>
#include <string>

#include "tests/support/temp_dir.hpp"

namespace maplet::daemon {
namespace {

TEST(OutputFile, WritesMoreThanItsBufferHolds) {
  const test::TempDir dir;
  const auto path = dir / "output";
  auto file = std::make_unique<OutputFile>();
  ASSERT_TRUE(file->open(path.c_str()));
  std::string expected;
  for (int i = 0; i < 20000; ++i) {
    const std::string line = std::to_string(i) + "\n";
    file->append(line);
    expected += line;
  }
  ASSERT_TRUE(file->close());
  std::ifstream in{path};
  EXPECT_EQ((std::string{std::istreambuf_iterator<char>{in}, {}}), expected);
}

TEST(OutputFile, KeepsTheFirstError) {
  auto file = std::make_unique<OutputFile>();
  EXPECT_FALSE(file->open("/nonexistent/folder/file"));
  EXPECT_EQ(file->error(), ENOENT);
  file->append("dropped");
  EXPECT_FALSE(file->close());
}

TEST(OutputFile, FullDiskIsAnError) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "SKIPPED: no /dev/full";
  auto file = std::make_unique<OutputFile>();
  ASSERT_TRUE(file->open("/dev/full"));
  file->append(std::string(200000, 'x'));
  EXPECT_FALSE(file->close());
  EXPECT_EQ(file->error(), ENOSPC);
}

}  // namespace
}  // namespace maplet::daemon
