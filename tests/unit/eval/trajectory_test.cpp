// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/eval/trajectory.hpp"

#include <gtest/gtest.h>

#include <sstream>

namespace maplet::eval {
namespace {

TEST(ParseStamp, IsExactToTheNanosecond) {
  EXPECT_EQ(parse_stamp("1305031102.175304"), Stamp{1305031102175304000});
  EXPECT_EQ(parse_stamp("1305031102.123456789"), Stamp{1305031102123456789});
  EXPECT_EQ(parse_stamp("0.000000001"), Stamp{1});
  EXPECT_EQ(parse_stamp("12"), Stamp{12'000'000'000});
  EXPECT_EQ(parse_stamp(".5"), Stamp{500'000'000});
  EXPECT_EQ(parse_stamp("-1.5"), Stamp{-1'500'000'000});
}

TEST(ParseStamp, CutsWhatIsFinerThanItsUnit) {
  EXPECT_EQ(parse_stamp("1.00000000199999999999999999"), Stamp{1'000'000'001});
}

TEST(ParseStamp, TakesExponents) {
  EXPECT_EQ(parse_stamp("1.305031102175304000e+09"), Stamp{1305031102175304000});
  EXPECT_EQ(parse_stamp("25e-1"), Stamp{2'500'000'000});
  EXPECT_EQ(parse_stamp("1e-12"), Stamp{0});
  EXPECT_EQ(parse_stamp("0.000123e2"), Stamp{12'300'000});
}

TEST(ParseStamp, RefusesWhatIsNoNumber) {
  for (const char* text : {"", ".", "-", "1.2.3", "12a", "nan", "inf", "1e", "e5", "1e99",
                           "99999999999", "0x10", "--1"}) {
    EXPECT_FALSE(parse_stamp(text)) << text;
  }
}

TEST(ReadTum, ReadsPosesCommentsAndEmptyLines) {
  std::istringstream in{
      "# stamp tx ty tz qx qy qz qw\n"
      "\n"
      "  2.5 1 2 3 0 0 0 1\r\n"
      "1.5\t-1 +2e0 3 0 0 0.7071 0.7071\n"};
  const Trajectory poses = read_tum(in, "t");
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_EQ(poses[0].stamp, Stamp{1'500'000'000});  // ordered by stamp
  EXPECT_EQ(poses[1].pose.t, (Eigen::Vector3d{1, 2, 3}));
  EXPECT_NEAR(poses[0].pose.q.norm(), 1.0, 1e-15);
  EXPECT_NEAR((poses[0].pose * Eigen::Vector3d{1, 0, 0} - Eigen::Vector3d{-1, 3, 3}).norm(), 0.0,
              1e-12);
}

/// What read_tum says about `line`, the second line of a file.
std::string complaint(const std::string& line) {
  std::istringstream in{"1 0 0 0 0 0 0 1\n" + line + "\n"};
  try {
    (void)read_tum(in, "truth.txt");
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

TEST(ReadTum, NamesTheLineThatIsNoPose) {
  EXPECT_EQ(complaint("hello"), "truth.txt:2: 'hello' is no time in seconds");
  EXPECT_EQ(complaint("2 0 0 0 0 0 0"), "truth.txt:2: expected 8 numbers: stamp x y z qx qy qz qw");
  EXPECT_EQ(complaint("2 0 0 0 0 0 0 1 9"),
            "truth.txt:2: more than 8 numbers: stamp x y z qx qy qz qw");
  EXPECT_EQ(complaint("2 0 nan 0 0 0 0 1"), "truth.txt:2: 'nan' is no finite number");
  EXPECT_EQ(complaint("2 0 1e999 0 0 0 0 1"), "truth.txt:2: '1e999' is no finite number");
  EXPECT_EQ(complaint("2 0 0 0 0 0 0 0"), "truth.txt:2: the quaternion's length is 0, not 1");
}

TEST(ReadTum, SaysWhichFileIsMissing) {
  try {
    (void)read_tum(std::filesystem::path{"/nowhere/truth.txt"});
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string{e.what()}.find("cannot read /nowhere/truth.txt"), std::string::npos);
  }
  EXPECT_THROW((void)read_tum(std::filesystem::temp_directory_path()), std::runtime_error);
}

}  // namespace
}  // namespace maplet::eval
