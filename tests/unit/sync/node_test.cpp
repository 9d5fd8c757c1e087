// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/sync/node.hpp"

#include <gtest/gtest.h>

#include "tests/support/exchange_world.hpp"

namespace maplet::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

double percentile(std::vector<double> values, double share) {
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

/// Bytes in the worst ten seconds.
std::size_t worst_window(const Robot& robot) {
  std::size_t worst = 0;
  for (std::size_t i = 0; i < robot.sent.size(); ++i) {
    std::size_t sum = 0;
    for (std::size_t j = i; j < robot.sent.size(); ++j) {
      if (robot.sent[j].first - robot.sent[i].first > seconds{10}) break;
      sum += robot.sent[j].second;
    }
    worst = std::max(worst, sum);
  }
  return worst;
}

/// How long each record took to reach everybody else, s.
std::vector<double> latencies(const World& world) {
  std::vector<double> all;
  for (const auto& [key, made] : world.made) {
    Instant last{};
    for (const auto& robot : world.robots) {
      if (robot->life.agent == key.agent) continue;
      const auto heard = robot->taker.heard_at.find(key);
      last = heard == robot->taker.heard_at.end() ? Instant::max() : std::max(last, heard->second);
      if (last == Instant::max()) break;
    }
    all.push_back(last == Instant::max() ? 1e9 : maplet::seconds(last - made));
  }
  return all;
}

TEST(Node, ThreeAgentsAreInSyncWithinTenSecondsOn64kbitWith30PercentLoss) {
  World world{1, {.loss = 0.3}};
  for (std::uint16_t i = 1; i <= 3; ++i) world.add(i, 100U + i, wifi_profile(), 2000.0);
  world.run(seconds{5});
  int step = 0;
  world.run(seconds{180}, [&] {
    if (++step % 100 == 0) world.make_delta(*world.robots[(step / 100) % 3]);
  });
  world.run(seconds{20});
  EXPECT_TRUE(world.same_records());
  const auto all = latencies(world);
  RecordProperty("p95_s", std::to_string(percentile(all, 0.95)));
  EXPECT_LE(percentile(all, 0.95), 10.0) << "p50 " << percentile(all, 0.5);
  for (const auto& robot : world.robots) EXPECT_EQ(robot->taker.twice, 0);
}

TEST(Node, CatchesUpWithinFiveSecondsAfterAMinutesCut) {
  World world{2, {.loss = 0.3}};
  for (std::uint16_t i = 1; i <= 3; ++i) world.add(i, 100U + i, wifi_profile(), 2000.0);
  std::vector<double> times;
  for (int round = 0; round < 10; ++round) {
    int step = 0;
    bool cut = false;
    world.connected = [&](const Robot& a, const Robot& b) {
      return !cut || (a.life.agent != 3 && b.life.agent != 3);
    };
    world.run(seconds{20});
    cut = true;
    world.run(seconds{60}, [&] {
      if (++step % 300 == 0) world.make_delta(*world.robots[(step / 300) % 3]);
    });
    cut = false;
    times.push_back(world.run_until_same(seconds{30}));
    EXPECT_GE(times.back(), 0.0);
  }
  EXPECT_LE(percentile(times, 0.95), 5.0) << "median " << percentile(times, 0.5);
}

TEST(Node, SlowRadioCarriesEverythingButMapletsInAMinute) {
  World world{3, {.loss = 0.1, .bytes_per_s = 1200.0}};
  for (std::uint16_t i = 1; i <= 3; ++i) world.add(i, 100U + i, radio_profile(), 300.0);
  world.run(seconds{10});
  int step = 0;
  world.run(seconds{240}, [&] {
    if (++step % 200 == 0) world.make_delta(*world.robots[(step / 200) % 3], step % 1000 == 0);
    if (step % 1000 == 1) world.make_maplet(*world.robots[(step / 1000) % 3], 4000);
  });
  world.run(seconds{60});
  EXPECT_TRUE(world.same_records());
  EXPECT_LE(percentile(latencies(world), 1.0), 60.0);
  for (const auto& robot : world.robots) {
    EXPECT_LE(worst_window(*robot), 300 * 10 * 1.05) << robot->life.agent;
    EXPECT_GT(robot->taker.maplets.size(), 8U);  // not starved
  }
}

TEST(Node, IdleCostsLessThanTwentyBytesASecond) {
  for (const LinkProfile& profile : {wifi_profile(), radio_profile()}) {
    World world{4, {.loss = 0.1}};
    for (std::uint16_t i = 1; i <= 3; ++i) world.add(i, 100U + i, profile, 2000.0);
    world.run(seconds{5});
    for (auto& robot : world.robots) world.make_delta(*robot);
    world.run(seconds{120});
    EXPECT_TRUE(world.same_records());
    for (auto& robot : world.robots) robot->sent_bytes = 0;
    world.run(seconds{600});
    for (auto& robot : world.robots) {
      // The rest of the 20 is DDS's own.
      EXPECT_LE(static_cast<double>(robot->sent_bytes) / 600.0, 7.0) << robot->life.agent;
    }
  }
}

TEST(Node, BudgetHoldsUnderPressure) {
  World world{5, {.loss = 0.2, .bytes_per_s = 1e6}};
  for (std::uint16_t i = 1; i <= 3; ++i) world.add(i, 100U + i, wifi_profile(), 2000.0);
  int step = 0;
  world.run(seconds{120}, [&] {
    if (++step % 10 == 0) world.make_delta(*world.robots[step / 10 % 3]);
    if (step % 100 == 0) world.make_maplet(*world.robots[step / 100 % 3], 7000);
  });
  for (const auto& robot : world.robots) {
    EXPECT_LE(worst_window(*robot), 2000 * 10 * 1.05);
    EXPECT_GE(worst_window(*robot), 2000 * 10 * 0.8);  // and is used
    EXPECT_GE(robot->taker.maplets.size(), 30U);       // own 40 and some: maplets do not starve
  }
}

TEST(Node, RelayCarriesRecordsToWhoNeverMeetsTheirOrigin) {
  World world{6, {}};
  for (std::uint16_t i = 1; i <= 3; ++i) world.add(i, 100U + i, wifi_profile(), 20000.0);
  Robot& a = *world.robots[0];
  Robot& b = *world.robots[1];
  Robot& c = *world.robots[2];
  for (int i = 0; i < 200; ++i) world.make_delta(a, i % 10 == 9);
  for (int i = 0; i < 10; ++i) world.make_maplet(a, 4000);
  const auto meet = [&](const Robot& x, const Robot& y) {
    world.connected = [&](const Robot& to, const Robot& from) {
      return (&to == &x && &from == &y) || (&to == &y && &from == &x);
    };
    const std::uint64_t before = a.sent_bytes + b.sent_bytes + c.sent_bytes;
    const auto silent = [&](Robot& robot) { robot.node.set_silent(&robot != &x && &robot != &y); };
    for (auto& robot : world.robots) silent(*robot);
    world.run(seconds{60});
    return static_cast<double>(a.sent_bytes + b.sent_bytes + c.sent_bytes - before);
  };
  const double first_hop = meet(a, b);
  EXPECT_EQ(a.node.ledger().records_digest(), b.node.ledger().records_digest());
  EXPECT_EQ(b.taker.maplets.size(), 10U);
  const double second_hop = meet(b, c);
  EXPECT_EQ(a.node.ledger().records_digest(), c.node.ledger().records_digest());
  EXPECT_EQ(c.taker.delta_poses, a.taker.delta_poses);
  EXPECT_EQ(c.taker.maplets, a.taker.maplets);
  EXPECT_LE(second_hop, 1.15 * first_hop);
}

TEST(Node, RestartWithANewEpochCatchesUp) {
  World world{7, {.loss = 0.2}};
  for (std::uint16_t i = 1; i <= 3; ++i) world.add(i, 100U + i, wifi_profile(), 2000.0);
  world.run(seconds{3});
  for (int round = 0; round < 20; ++round) {
    for (auto& robot : world.robots) {
      for (int i = 0; i < 3; ++i) world.make_delta(*robot);
    }
    world.run(milliseconds{static_cast<int>(world.rng() % 3000)});
    const std::size_t victim = world.rng() % 3;
    const Life life = world.robots[victim]->life;
    world.forget(*world.robots[victim]);
    world.robots[victim] = std::make_unique<Robot>(Life{life.agent, life.epoch + 1000},
                                                   wifi_profile(), 2000.0, world.now);
  }
  EXPECT_GE(world.run_until_same(seconds{60}), 0.0);
  for (const auto& robot : world.robots) {
    EXPECT_EQ(robot->node.counters().forged_own, 0U);
    EXPECT_EQ(robot->node.peer_table().conflicts(), 0U);
  }
}

TEST(Node, TwoAgentsWithOneIdAreNoticedAndHarmNobody) {
  World world{8, {}};
  world.add(1, 100, wifi_profile(), 2000.0);
  world.add(2, 200, wifi_profile(), 2000.0);
  world.add(2, 201, wifi_profile(), 2000.0);
  int step = 0;
  world.run(seconds{60}, [&] {
    if (++step % 200 == 0) world.make_delta(*world.robots[step / 200 % 3]);
  });
  EXPECT_GE(world.run_until_same(seconds{30}), 0.0);
  EXPECT_GT(world.robots[0]->node.peer_table().conflicts(), 0U);
  EXPECT_EQ(world.robots[0]->node.peer_table().conflicting_agent(), 2);
  EXPECT_GT(world.robots[1]->node.peer_table().conflicts(), 0U);
  EXPECT_GT(world.robots[2]->node.peer_table().conflicts(), 0U);
  EXPECT_EQ(world.robots[0]->taker.delta_poses, world.robots[1]->taker.delta_poses);
}

// A copied journal: the same agent in the same epoch.
TEST(Node, ADoubleWithTheSameEpochIsNoticedByBoth) {
  World world{8, {}};
  world.add(2, 200, wifi_profile(), 2000.0);
  world.add(2, 200, wifi_profile(), 2000.0);
  for (auto& robot : world.robots) robot->node.wake(world.now);
  int step = 0;
  world.run(seconds{30}, [&] {
    if (++step % 200 == 0) world.make_delta(*world.robots[step / 200 % 2]);
  });
  for (auto& robot : world.robots) {
    EXPECT_GT(robot->node.peer_table().conflicts(), 0U);
    EXPECT_EQ(robot->node.peer_table().conflicting_agent(), 2);
  }
}

TEST(Node, AFullTakerGetsItLater) {
  World world{9, {}};
  world.add(1, 100, wifi_profile(), 2000.0);
  Robot& b = world.add(2, 200, wifi_profile(), 2000.0);
  b.taker.open = false;
  for (int i = 0; i < 5; ++i) world.make_delta(*world.robots[0]);
  world.make_maplet(*world.robots[0], 3000);
  world.run(seconds{10});
  EXPECT_TRUE(b.taker.delta_poses.empty());
  EXPECT_GT(b.node.counters().refused, 0U);
  b.taker.open = true;
  EXPECT_GE(world.run_until_same(seconds{40}), 0.0);
  world.run(seconds{40});
  EXPECT_EQ(b.taker.delta_poses.size(), 5U);
  EXPECT_EQ(b.taker.maplets.size(), 1U);
}

TEST(Node, ClocksHoursApartLoseNothingAndAreMeasured) {
  World world{10, {.loss = 0.1}};
  Robot& a = world.add(1, 100, wifi_profile(), 2000.0);
  Robot& b = world.add(2, 200, wifi_profile(), 2000.0);
  b.node.set_record_clock(Stamp{std::chrono::hours{24 * 365 * 50}}, world.now);
  a.node.set_record_clock(Stamp{std::chrono::hours{7}}, world.now);
  int step = 0;
  const auto work = [&] {
    if (++step % 100 == 0) world.make_delta(*world.robots[step / 100 % 2]);
  };
  world.run(seconds{30}, work);
  const Peer& peer = a.node.peers()[0];
  ASSERT_TRUE(peer.has_offset);
  EXPECT_NEAR(maplet::seconds(peer.clock_offset), (24.0 * 365 * 50 - 7.0) * 3600.0, 0.2);
  a.node.set_record_clock(Stamp{std::chrono::hours{1}}, world.now);  // it jumps back six hours
  world.run(seconds{90}, work);
  EXPECT_GE(world.run_until_same(seconds{30}), 0.0);
  EXPECT_NEAR(maplet::seconds(a.node.peers()[0].clock_offset),
              (24.0 * 365 * 50 - 1.0) * 3600.0 + 30.0, 0.2);
}

TEST(Node, CountsAndSequenceNumbersWrap) {
  Arena arena;
  Peers peers{4, arena};
  const Instant now{std::chrono::hours{1}};
  for (std::uint32_t count = 65'530; count < 65'545; ++count) {  // the datagrams' count
    (void)peers.heard({{2, 7}, static_cast<std::uint16_t>(count)}, 100, now);
  }
  EXPECT_EQ(peers.all()[0].lost, 0U);
  World world{12, {}};
  Robot& a = world.add(1, 100, wifi_profile(), 2000.0);
  Robot& b = world.add(2, 200, wifi_profile(), 2000.0);
  a.next_seq = 0xFFFFFFFD;  // the last two numbers; a life that used them up is over
  const RecordKey key = world.make_delta(a);
  (void)world.make_delta(a);
  DeltaPose delta = random_delta(world.rng, 1, 100, 0);
  const auto beyond = quantise(delta, 1, 100, 0xFFFFFFFF);
  EXPECT_FALSE(beyond && a.node.put(*beyond, world.now));
  world.run(seconds{10});
  EXPECT_EQ(b.taker.delta_poses.size(), 2U);
  EXPECT_TRUE(b.node.ledger().contains(key));
  EXPECT_TRUE(world.same_records());
}

// A hundred restarts: each life is told apart, and the others go on.
TEST(Node, AHundredLivesAreKeptApart) {
  World world{13, {.loss = 0.1}};
  for (std::uint16_t i = 1; i <= 3; ++i) world.add(i, 100U + i, wifi_profile(), 20000.0);
  world.run(seconds{2});
  for (int round = 0; round < 100; ++round) {
    for (auto& robot : world.robots) world.make_delta(*robot);
    world.run(milliseconds{static_cast<int>(world.rng() % 2000)});
    const std::size_t victim = 1 + world.rng() % 2;  // somebody remembers
    const Life life = world.robots[victim]->life;
    world.forget(*world.robots[victim]);
    world.robots[victim] = std::make_unique<Robot>(Life{life.agent, life.epoch + 1000},
                                                   wifi_profile(), 20000.0, world.now);
  }
  EXPECT_GE(world.run_until_same(seconds{180}), 0.0);
  EXPECT_GT(world.robots[0]->node.ledger().rows().size(), 64U);
  EXPECT_EQ(world.robots[0]->node.ledger().refused(), 0U);
}

// A relay tells of thirty agents: a digest each way and the records, once.
TEST(Node, AMeetingOfTwoCostsLittleMoreThanTheRecords) {
  World world{14, {.delay = milliseconds{30}, .bytes_per_s = 1e6}};
  world.add(1, 100, wifi_profile(), 20000.0);
  Robot& relay = *world.robots[0];
  std::size_t records = 0;
  std::size_t record_bytes = 0;
  for (std::uint16_t agent = 2; agent < 32; ++agent) {
    RecordContext context{agent, agent};
    for (std::uint32_t seq = 0; seq < 10; ++seq) {
      const auto record = quantise(random_delta(world.rng, agent, agent, seq), agent, agent, seq);
      ASSERT_TRUE(record);
      relay.node.restore(*record);
      relay.taker.delta_poses.emplace(record->key, *record);
      std::array<std::byte, kMaxRecordBytes> body;
      ByteWriter out{body};
      write_record(out, context, *record);
      record_bytes += out.size() + 2;
      ++records;
    }
  }
  Robot& guest = world.add(40, 40, wifi_profile(), 20000.0);
  for (auto& robot : world.robots) robot->node.wake(world.now);
  EXPECT_GE(world.run_until_same(seconds{20}), 0.0);
  EXPECT_EQ(guest.taker.delta_poses.size(), records);
  EXPECT_EQ(guest.node.counters().duplicates, 0U);
  std::size_t datagrams = 0;
  for (const auto& robot : world.robots) datagrams += robot->sent.size();
  const std::size_t said = relay.sent_bytes + guest.sent_bytes - datagrams * kWireOverhead;
  EXPECT_LE(static_cast<double>(said), 1.15 * static_cast<double>(record_bytes));
}

TEST(Node, SilenceHearsAndSaysNothing) {
  World world{11, {}};
  Robot& a = world.add(1, 100, wifi_profile(), 2000.0);
  Robot& b = world.add(2, 200, wifi_profile(), 2000.0);
  b.node.set_silent(true);
  for (int i = 0; i < 5; ++i) world.make_delta(a);
  for (int i = 0; i < 5; ++i) world.make_delta(b);
  world.run(seconds{20});
  EXPECT_EQ(b.sent_bytes, 0U);
  EXPECT_EQ(b.taker.delta_poses.size(), 10U);
  EXPECT_EQ(a.taker.delta_poses.size(), 5U);
  b.node.set_silent(false);
  b.node.wake(world.now);
  EXPECT_GE(world.run_until_same(seconds{10}), 0.0);
}

}  // namespace
}  // namespace maplet::test
