// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/pacer.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace maplet::daemon {
namespace {

using std::chrono::milliseconds;

const std::atomic<bool> kGoOn{false};

TEST(Pacer, FastHasNoDeadline) {
  Pacer pacer{Pacer::Mode::kFast};
  ASSERT_TRUE(pacer.wait(milliseconds{1000}, kGoOn));
  const Deadline deadline = pacer.deadline(std::chrono::nanoseconds{1});
  std::this_thread::sleep_for(milliseconds{2});
  EXPECT_FALSE(deadline.expired());
  ASSERT_TRUE(pacer.wait(milliseconds{1033}, kGoOn));
}

TEST(Pacer, RecordedWaitsForTheStamp) {
  Pacer pacer{Pacer::Mode::kRecorded};
  ASSERT_TRUE(pacer.wait(milliseconds{500}, kGoOn));
  const Instant start = MonotonicClock{}.now();
  EXPECT_TRUE(pacer.wait(milliseconds{520}, kGoOn));
  EXPECT_GE(MonotonicClock{}.now() - start, milliseconds{19});
}

TEST(Pacer, RecordedDropsWhatComesTooLate) {
  Pacer pacer{Pacer::Mode::kRecorded};
  ASSERT_TRUE(pacer.wait(milliseconds{0}, kGoOn));
  std::this_thread::sleep_for(milliseconds{30});
  EXPECT_FALSE(pacer.wait(milliseconds{2}, kGoOn));
}

TEST(Pacer, RecordedGoesOnWithASourceSlowerThanItsStamps) {
  Pacer pacer{Pacer::Mode::kRecorded};
  ASSERT_TRUE(pacer.wait(milliseconds{0}, kGoOn));
  int taken = 0;
  for (int i = 1; i <= 30; ++i) {  // a frame every 10 ms, stamped every 2 ms
    std::this_thread::sleep_for(milliseconds{10});
    if (pacer.wait(milliseconds{2 * i}, kGoOn)) ++taken;
  }
  EXPECT_GE(taken, 4);  // dropping all that is late would leave none
}

TEST(Pacer, RecordedStopsWaitingWhenToldTo) {
  Pacer pacer{Pacer::Mode::kRecorded};
  ASSERT_TRUE(pacer.wait(milliseconds{0}, kGoOn));
  const std::atomic<bool> stop{true};
  const Instant start = MonotonicClock{}.now();
  EXPECT_TRUE(pacer.wait(std::chrono::hours{1}, stop));
  EXPECT_LT(MonotonicClock{}.now() - start, std::chrono::seconds{10});
}

}  // namespace
}  // namespace maplet::daemon
