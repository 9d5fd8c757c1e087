// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/replay_window.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

namespace maplet {
namespace {

TEST(ReplayWindow, TakesEachCounterOnceWithinItsWidth) {
  std::mt19937 dice{1};
  ReplayWindow window;
  std::set<std::uint32_t> taken;
  std::uint32_t top = 0;
  for (int i = 0; i < 20000; ++i) {
    const std::uint32_t counter =
        1 + static_cast<std::uint32_t>(i / 4) + static_cast<std::uint32_t>(dice() % 90);
    const bool good =
        counter > top || (top - counter < ReplayWindow::kWidth && !taken.contains(counter));
    ASSERT_EQ(window.fresh(counter), good) << counter << " after " << top;
    if (!good) continue;
    window.note(counter);
    taken.insert(counter);
    top = std::max(top, counter);
  }
}

TEST(ReplayWindow, LeapsFurtherThanItsWidth) {
  ReplayWindow window{5};
  for (std::uint32_t counter = 0; counter <= 5; ++counter) EXPECT_FALSE(window.fresh(counter));
  window.note(5 + ReplayWindow::kWidth);
  EXPECT_FALSE(window.fresh(5));
  EXPECT_TRUE(window.fresh(6));
  window.note(0xFFFFFF);
  EXPECT_FALSE(window.fresh(0xFFFFFF));
  EXPECT_TRUE(window.fresh(0xFFFFFF - 63));
  EXPECT_FALSE(window.fresh(0xFFFFFF - 64));
}

}  // namespace
}  // namespace maplet
