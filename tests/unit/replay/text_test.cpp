// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/text.hpp"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/temp_dir.hpp"

namespace maplet {
namespace {

TEST(Stamps, AreExactToTheNanosecond) {
  // The double nearest to this is 238 ns off.
  EXPECT_EQ(parse_stamp("1341836537.655691"), Stamp{1341836537655691000});
  EXPECT_EQ(parse_stamp("1341836537.123456789"), Stamp{1341836537123456789});
  EXPECT_EQ(parse_stamp("0.033333"), Stamp{33333000});
  EXPECT_EQ(parse_stamp("12"), Stamp{12'000'000'000});
  EXPECT_EQ(parse_stamp("12."), Stamp{12'000'000'000});
  EXPECT_EQ(parse_stamp(".5"), Stamp{500'000'000});
  EXPECT_EQ(parse_stamp("-0.25"), Stamp{-250'000'000});
  EXPECT_EQ(parse_stamp("0"), Stamp{0});
}

TEST(Stamps, RoundDigitsBeyondTheNinth) {
  EXPECT_EQ(parse_stamp("0.0000000014"), Stamp{1});
  EXPECT_EQ(parse_stamp("0.0000000015"), Stamp{2});
  EXPECT_EQ(parse_stamp("0.0000000004999"), Stamp{0});
}

TEST(Stamps, TakeExponents) {
  EXPECT_EQ(parse_stamp("1.341836537655691e+09"), Stamp{1341836537655691000});
  EXPECT_EQ(parse_stamp("1.341836537655691147e9"), Stamp{1341836537655691147});
  EXPECT_EQ(parse_stamp("25e-1"), Stamp{2'500'000'000});
  EXPECT_EQ(parse_stamp("0e99"), Stamp{0});
  EXPECT_EQ(parse_stamp("1e-99"), Stamp{0});
}

TEST(Stamps, RefuseWhatIsNoNumber) {
  for (const char* text : {"", "-", ".", "+.", "1.2.3", "1,5", "0x10", "nan", "inf", "1e", "1e+",
                           "1e100", "1e400", "99999999999999999999", "9e17", "1.5s", " 1"}) {
    EXPECT_FALSE(parse_stamp(text)) << text;
  }
}

TEST(Stamps, SurviveARoundTrip) {
  EXPECT_EQ(format_stamp(Stamp{1341836537655691000}), "1341836537.655691");
  EXPECT_EQ(format_stamp(Stamp{1}), "0.000000001");
  EXPECT_EQ(format_stamp(Stamp{-1'500'000'000}), "-1.500000");
  std::mt19937_64 random{3};
  for (int i = 0; i < 1000; ++i) {
    const Stamp stamp{static_cast<std::int64_t>(random()) / 2};
    ASSERT_EQ(parse_stamp(format_stamp(stamp)), stamp);
  }
}

TEST(ImageLists, TakeCommentsBlanksAndWindowsLineEnds) {
  const auto images = parse_image_list(
      "# depth maps\r\n\r\n0.5 depth/a.png\r\n  1.5\tdepth/b.png extra # comment\n\n2.5 "
      "depth/c.png");
  ASSERT_EQ(images.size(), 3u);
  EXPECT_EQ(images[0].stamp, Stamp{500'000'000});
  EXPECT_EQ(images[0].file, "depth/a.png");
  EXPECT_EQ(images[1].file, "depth/b.png");
  EXPECT_EQ(images[1].line, 4);
  EXPECT_EQ(images[2].file, "depth/c.png");
}

TEST(ImageLists, KeepTheLinesThatMakeNoSense) {
  const auto images = parse_image_list("0.5 a.png\nrubbish\n1.5\n2.5 b.png\n3.5 c\x01.png\n");
  ASSERT_EQ(images.size(), 5u);
  for (const int bad : {1, 2, 4}) {
    EXPECT_FALSE(images[bad].stamp) << bad;
    EXPECT_EQ(images[bad].line, bad + 1);
  }
  EXPECT_EQ(images[3].file, "b.png");
}

TEST(TextFiles, ComeWholeOrWithAReason) {
  const test::TempDir dir;
  test::write_bytes(dir / "a.txt", "one\ntwo");
  EXPECT_EQ(read_text(dir / "a.txt", 100).value(), "one\ntwo");
  EXPECT_NE(read_text(dir / "a.txt", 3).error().find("larger than 3"), std::string::npos);
  EXPECT_NE(read_text(dir / "b.txt", 100).error().find("b.txt: No such file"), std::string::npos);
  EXPECT_NE(read_text(dir.path(), 100).error().find("not a file"), std::string::npos);
}

}  // namespace
}  // namespace maplet
