// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/pacer.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace maplet::daemon {
namespace {

using std::chrono::milliseconds;

const std::atomic<bool> kGoOn{false};

TEST(Pacer, FastStandsStillInsideAStep) {
  Pacer pacer{Pacer::Mode::kFast};
  ASSERT_TRUE(pacer.wait(milliseconds{1000}, kGoOn));
  const Instant first = pacer.clock().now();
  std::this_thread::sleep_for(milliseconds{2});
  EXPECT_EQ(pacer.clock().now(), first);
  ASSERT_TRUE(pacer.wait(milliseconds{1033}, kGoOn));
  EXPECT_EQ(pacer.clock().now() - first, milliseconds{33});
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
