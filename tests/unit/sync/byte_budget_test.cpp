// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/sync/byte_budget.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "transport/sync/scheduler.hpp"

namespace maplet {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

struct Sent {
  Instant at;
  std::size_t bytes;
};

double worst_rate(const std::vector<Sent>& sent) {
  double worst = 0.0;
  for (std::size_t i = 0; i < sent.size(); ++i) {
    double sum = 0.0;
    for (std::size_t j = i; j < sent.size() && sent[j].at - sent[i].at <= seconds{10}; ++j) {
      sum += static_cast<double>(sent[j].bytes);
    }
    worst = std::max(worst, sum / 10.0);
  }
  return worst;
}

TEST(ByteBudget, NoTenSecondsAreOverdrawnWhateverOthersAnnounce) {
  for (const double rate : {250.0, 2000.0, 50000.0}) {
    std::mt19937 rng{1};
    Instant now{seconds{100}};
    ByteBudget budget{rate, 600, now};
    std::vector<Sent> sent;
    for (int i = 0; i < 60'000; ++i) {
      now += milliseconds{5};
      if (i % 6000 == 5999) {  // DDS says every 30 s that it is there
        budget.charge_others(440, now);
        sent.push_back({now, 440});
      }
      const std::size_t bytes = 120 + rng() % 480;
      if (!budget.allows(bytes, now)) continue;
      budget.charge(bytes, now);
      sent.push_back({now, bytes});
    }
    std::erase_if(sent, [](const Sent& s) { return s.at < Instant{seconds{160}}; });
    EXPECT_LE(worst_rate(sent), 1.05 * rate);
    EXPECT_GE(worst_rate(sent), 0.75 * rate);
  }
}

TEST(ByteBudget, EvensTheFlowOut) {
  Instant now{seconds{100}};
  ByteBudget budget{1000.0, 600, now};
  now += seconds{60};
  std::size_t at_once = 0;
  while (budget.allows(100, now)) {
    budget.charge(100, now);
    at_once += 100;
  }
  EXPECT_LE(at_once, 700U);  // and not ten seconds' worth
}

TEST(Scheduler, SharesByWeightAndStarvesNobody) {
  Scheduler scheduler;
  std::array<std::size_t, kTraffics> bytes{};
  Waiting all;
  for (std::size_t i = 0; i < kTraffics; ++i) all.set(static_cast<Traffic>(i));
  for (int i = 0; i < 10'000; ++i) {
    const auto next = scheduler.pick(all);
    ASSERT_TRUE(next);
    bytes[static_cast<std::size_t>(*next)] += 500;
    scheduler.charge(*next, 500);
  }
  EXPECT_NEAR(static_cast<double>(bytes[0]) / 5e6, 0.5, 0.01);
  EXPECT_NEAR(static_cast<double>(bytes[4]) / 5e6, 1.0 / 16.0, 0.01);
}

TEST(Scheduler, IdleTimeIsNotSavedUp) {
  Scheduler scheduler;
  Waiting maplets;
  maplets.set(Traffic::kMaplets);
  for (int i = 0; i < 1000; ++i) {
    (void)scheduler.pick(maplets);
    scheduler.charge(Traffic::kMaplets, 1000);
  }
  Waiting both = maplets;
  both.set(Traffic::kDeltaPoses);
  int delta_poses = 0;
  for (int i = 0; i < 900; ++i) {
    const auto next = scheduler.pick(both);
    delta_poses += *next == Traffic::kDeltaPoses;
    scheduler.charge(*next, 100);
  }
  EXPECT_NEAR(delta_poses, 809, 3);  // 16 of 18 after the last large one, not all
}

}  // namespace
}  // namespace maplet
