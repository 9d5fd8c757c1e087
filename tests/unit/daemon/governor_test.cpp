// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/governor.hpp"

#include <gtest/gtest.h>

namespace maplet::daemon {
namespace {

using std::chrono::milliseconds;
constexpr Duration kWhole = milliseconds{20};

TEST(Governor, LeavesAQuickMachineAlone) {
  Governor governor;
  for (int i = 0; i < 1000; ++i) {
    EXPECT_FALSE(governor.skips());
    governor.done(milliseconds{5}, kWhole);
  }
  EXPECT_EQ(governor.budget(kWhole), kWhole);
  EXPECT_FALSE(governor.degraded());
}

TEST(Governor, TakesFromTheBudgetWhenLateAndGivesItBack) {
  Governor governor;
  governor.done(milliseconds{22}, kWhole);
  EXPECT_EQ(governor.budget(kWhole), milliseconds{18});
  EXPECT_TRUE(governor.degraded());
  for (int i = 0; i < 60; ++i) governor.done(milliseconds{10}, kWhole);
  EXPECT_FALSE(governor.degraded());
}

// Stages that use all they get and overrun by a sixth: the frames come to stay inside the budget.
TEST(Governor, FindsTheBudgetThatHolds) {
  Governor governor;
  int late = 0;
  for (int i = 0; i < 2000; ++i) {
    const Duration took = governor.budget(kWhole) * 7 / 6;
    if (took > kWhole) ++late;
    governor.done(took, kWhole);
  }
  EXPECT_LE(late, 20);
  EXPECT_EQ(governor.skipped(), 0U);
}

TEST(Governor, LeavesFramesOutWhenTheLeastBudgetIsNotEnough) {
  Governor governor;
  int worked_at = 0;
  for (int i = 0; i < 400; ++i) {
    if (governor.skips()) continue;
    ++worked_at;
    governor.done(milliseconds{30}, kWhole);
  }
  EXPECT_LT(worked_at, 150);
  EXPECT_GE(worked_at, 400 / Governor::kMostInterval);
  EXPECT_EQ(governor.skipped(), 400U - static_cast<unsigned>(worked_at));
  for (int i = 0; i < 2000; ++i) {
    if (!governor.skips()) governor.done(milliseconds{5}, kWhole);
  }
  EXPECT_FALSE(governor.degraded());
}

}  // namespace
}  // namespace maplet::daemon
