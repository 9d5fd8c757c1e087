// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/base/deadline.hpp"

#include <gtest/gtest.h>

namespace maplet {
namespace {

using std::chrono::milliseconds;

TEST(Deadline, ExpiresWithItsClock) {
  ManualClock clock;
  const Deadline deadline{clock, milliseconds{5}};
  EXPECT_FALSE(deadline.expired());
  clock.advance(milliseconds{5});
  EXPECT_TRUE(deadline.expired());
}

TEST(Deadline, InnerOneIsNeverLater) {
  ManualClock clock;
  const Deadline outer{clock, milliseconds{5}};
  const Deadline longer = outer.within(milliseconds{50});
  const Deadline shorter = outer.within(milliseconds{2});
  clock.advance(milliseconds{3});
  EXPECT_TRUE(shorter.expired());
  EXPECT_FALSE(longer.expired());
  clock.advance(milliseconds{2});
  EXPECT_TRUE(longer.expired());
}

TEST(Deadline, NeverStaysOpen) {
  EXPECT_FALSE(Deadline::never().expired());
  EXPECT_FALSE(Deadline::never().within(Duration{0}).expired());
}

}  // namespace
}  // namespace maplet
