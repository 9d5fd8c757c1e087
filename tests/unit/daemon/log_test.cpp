// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/log.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

namespace maplet::daemon {
namespace {

/// Lines on standard error while `work` runs.
template <class Work>
std::string said_by(Work work) {
  testing::internal::CaptureStderr();
  work();
  return testing::internal::GetCapturedStderr();
}

TEST(FewLines, TenAtOnceAndAWordThatThereAreMore) {
  FewLines lines;
  const std::string said = said_by([&] {
    for (int i = 0; i < 1000; ++i) lines.say("frame " + std::to_string(i) + " is damaged");
    lines.flush();
  });
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 11) << said;
  EXPECT_NE(said.find("mapletd: frame 0 is damaged"), std::string::npos) << said;
  EXPECT_NE(said.find("frame 9 is damaged"), std::string::npos) << said;
  EXPECT_NE(said.find("more of this kind is counted"), std::string::npos) << said;
  const std::string later = said_by([&] {
    lines.say("one more");
    lines.flush();
  });
  EXPECT_EQ(later, "");
}

TEST(FewLines, ALongLineIsCut) {
  FewLines lines;
  const std::string said = said_by([&] {
    lines.say(std::string(10'000, 'x'));
    lines.flush();
  });
  EXPECT_LT(said.size(), 1000u);
  EXPECT_GT(said.size(), 50u);
}

}  // namespace
}  // namespace maplet::daemon
