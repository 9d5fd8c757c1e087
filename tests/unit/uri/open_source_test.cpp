// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/open_source.hpp"

#include <gtest/gtest.h>

#include "tests/support/recordings.hpp"

namespace maplet {
namespace {

using Kind = SourceError::Kind;

SourceError error_of(std::string_view uri) {
  auto opened = open_source(uri, {});
  return opened ? SourceError{Kind::kBad, "it opened"} : opened.error();
}

TEST(OpenSource, ListsTheSchemesWhenItDoesNotKnowOne) {
  const SourceError error = error_of("rosbag:x.bag");
  EXPECT_EQ(error.kind, Kind::kUsage);
  EXPECT_NE(error.what.find("'rosbag:'"), std::string::npos) << error.what;
  EXPECT_NE(error.what.find("tum:DIR"), std::string::npos) << error.what;
}

TEST(OpenSource, TellsUsageFromBadInput) {
  for (const char* uri : {"", "folder/without/scheme", "tum:", "tum:x?n=1", "tum:x?every=0",
                          "tum:x?first=-1", "tum:x?count=two"}) {
    EXPECT_EQ(error_of(uri).kind, Kind::kUsage) << uri << ": " << error_of(uri).what;
  }
  const SourceError missing = error_of("tum:/nowhere/at/all");
  EXPECT_EQ(missing.kind, Kind::kBad);
  EXPECT_NE(missing.what.find("/nowhere/at/all"), std::string::npos) << missing.what;
}

TEST(OpenSource, OpensARecording) {
  MAPLET_RECORDING(folder, "rgbd/redkitchen_a");
  auto source = open_source("tum:" + folder.string() + "?first=490&every=4", {});
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_EQ((*source)->length(), 3u);
  ASSERT_TRUE((*source)->next(Deadline::never()));
}

}  // namespace
}  // namespace maplet
