// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/pacer.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace maplet::daemon {
namespace {

using std::chrono::milliseconds;

const std::atomic<bool> kGoOn{false};

Duration time_of_wait(Pacer& pacer, Stamp stamp, const std::atomic<bool>& stop = kGoOn) {
  const Instant start = MonotonicClock{}.now();
  pacer.wait(stamp, stop);
  return MonotonicClock{}.now() - start;
}

TEST(Pacer, OnlyRecordedWaits) {
  for (const Pace pace : {Pace::kFast, Pace::kLive}) {
    Pacer pacer{pace};
    pacer.wait(milliseconds{0}, kGoOn);
    EXPECT_LT(time_of_wait(pacer, std::chrono::hours{1}), std::chrono::seconds{10});
  }
}

TEST(Pacer, RecordedWaitsForTheStamp) {
  Pacer pacer{Pace::kRecorded};
  pacer.wait(milliseconds{500}, kGoOn);
  EXPECT_GE(time_of_wait(pacer, milliseconds{520}), milliseconds{19});
}

TEST(Pacer, RecordedCountsAnewFromAFrameThatCameLate) {
  Pacer pacer{Pace::kRecorded};
  pacer.wait(milliseconds{0}, kGoOn);
  std::this_thread::sleep_for(milliseconds{60});
  pacer.wait(milliseconds{10}, kGoOn);  // at least 50 ms late
  EXPECT_GE(time_of_wait(pacer, milliseconds{40}), milliseconds{29});
}

TEST(Pacer, RecordedStopsWaitingWhenToldTo) {
  Pacer pacer{Pace::kRecorded};
  pacer.wait(milliseconds{0}, kGoOn);
  const std::atomic<bool> stop{true};
  EXPECT_LT(time_of_wait(pacer, std::chrono::hours{1}, stop), std::chrono::seconds{10});
}

}  // namespace
}  // namespace maplet::daemon
