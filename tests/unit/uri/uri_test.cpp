// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/uri.hpp"

#include <gtest/gtest.h>

namespace maplet {
namespace {

TEST(Uri, FallsIntoSchemePathAndParameters) {
  const auto uri = Uri::parse("TUM:/data/red kitchen?first=10&count=5&note=a=b");
  ASSERT_TRUE(uri) << uri.error();
  EXPECT_EQ(uri->scheme, "tum");
  EXPECT_EQ(uri->path, "/data/red kitchen");
  EXPECT_EQ(uri->parameters.at("first"), "10");
  EXPECT_EQ(uri->parameters.at("note"), "a=b");
}

TEST(Uri, MayHaveNothingBehindTheColon) {
  EXPECT_EQ(Uri::parse("openni2:").value().path, "");
  EXPECT_EQ(Uri::parse("openni2:?").value().parameters.size(), 0u);
  EXPECT_EQ(Uri::parse("openni2:1d27/0601@1/5").value().path, "1d27/0601@1/5");
}

TEST(Uri, DecodesPercents) {
  const auto uri = Uri::parse("tum:50%25%20of%3fit?k%26=%3D%41");
  ASSERT_TRUE(uri) << uri.error();
  EXPECT_EQ(uri->path, "50% of?it");
  EXPECT_EQ(uri->parameters.at("k&"), "=A");
}

TEST(Uri, RefusesInOneLine) {
  const std::string samples[] = {
      "",           "room",     ":x",       "/data/x:y",           "1x:y",
      "tum:a%",     "tum:a%2",  "tum:%zz",  "tum:a%00b",           "tum:a%0Ab",
      "tum:a\nb",   "tum:a?b",  "tum:a?=c", "tum:a?b=%",           "tum:a?b=1&b=2",
      "tum:a?&b=1", "tum:%-1x", "a\nb:c",   std::string(9000, 'a')};
  for (const std::string& text : samples) {
    const auto uri = Uri::parse(text);
    ASSERT_FALSE(uri) << text;
    EXPECT_FALSE(uri.error().empty());
    EXPECT_EQ(uri.error().find('\n'), std::string::npos) << uri.error();
  }
}

TEST(Uri, NamesTheParameterThatNobodyKnows) {
  const auto uri = Uri::parse("tum:a?frist=1").value();
  const auto known = uri.only({"first", "count"});
  ASSERT_FALSE(known);
  EXPECT_EQ(known.error(), "tum: no parameter 'frist'; there are first, count");
  EXPECT_TRUE(uri.only({"frist"}));
  EXPECT_NE(uri.only({}).error().find("takes no parameters"), std::string::npos);
}

TEST(Uri, CountsAreWholeNumbersInRange) {
  const auto uri = Uri::parse("tum:a?n=12&neg=-1&real=1.5&big=99999999999999999999&no=").value();
  EXPECT_EQ(uri.count("n", 0, 0, 100), 12u);
  EXPECT_EQ(uri.count("absent", 7, 0, 100), 7u);
  EXPECT_EQ(uri.count("n", 0, 0, 11).error(), "tum: n=12: expected a whole number from 0 to 11");
  for (const char* key : {"neg", "real", "big", "no"})
    EXPECT_FALSE(uri.count(key, 0, 0, 100)) << key;
}

}  // namespace
}  // namespace maplet
