// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <vector>

#include "core/base/crc.hpp"
#include "tests/support/records.hpp"
#include "transport/sync/byte_budget.hpp"
#include "transport/sync/node.hpp"

namespace maplet::test {

/// What DDS, UDP and IP add to a datagram of ours (measured: docs/dds.md).
inline constexpr std::size_t kWireOverhead = 92;

/// Keeps what it is given.
struct Collector final : RecordTaker {
  std::map<RecordKey, DeltaPoseRecord> delta_poses;
  std::map<RecordKey, RangeRecord> ranges;
  std::map<MapletKey, std::vector<std::byte>> maplets;
  std::map<RecordKey, Instant> heard_at;
  Instant now{};
  bool open = true;
  bool want_maplets = true;
  int twice = 0;

  bool take(const DeltaPoseRecord& record) noexcept override {
    if (!open) return false;
    if (!delta_poses.emplace(record.key, record).second) ++twice;
    heard_at.emplace(record.key, now);
    return true;
  }
  bool take(const RangeRecord& record) noexcept override {
    if (!open) return false;
    if (!ranges.emplace(record.key, record).second) ++twice;
    return true;
  }
  bool take(const MapletKey& key, std::span<const std::byte> bytes) noexcept override {
    if (!open) return false;
    if (!maplets.emplace(key, std::vector(bytes.begin(), bytes.end())).second) ++twice;
    return true;
  }
  float wish(const MapletKey&, float saliency) noexcept override {
    return want_maplets ? saliency : -1.0F;
  }
};

struct Robot {
  Robot(Life who, const LinkProfile& profile, double bytes_per_s, Instant now,
        const SyncConfig& config = {})
      : node{config, profile, 8192, who, taker, arena},
        budget{bytes_per_s, profile.datagram_bytes + kWireOverhead, now},
        life{who},
        datagram_bytes{profile.datagram_bytes} {}

  Arena arena{std::size_t{1} << 28};
  Collector taker;
  ExchangeNode node;
  ByteBudget budget;
  Life life;
  std::size_t datagram_bytes;
  std::uint32_t next_seq = 0;
  std::uint32_t next_closure_seq = 0;
  std::uint32_t next_maplet = 0;
  std::uint64_t sent_bytes = 0;  ///< on the wire
  std::vector<std::pair<Instant, std::size_t>> sent;
};

/// A shared radio channel in simulated time: every datagram reaches everybody who is connected,
/// each with its own luck.
class World {
 public:
  struct Channel {
    double loss = 0.0;
    double burst = 0.0;  ///< chance that a loss goes on to the next datagram
    Duration delay = std::chrono::milliseconds{200};
    double bytes_per_s = 8000.0;
  };
  static constexpr Duration kStep = std::chrono::milliseconds{10};

  World(std::uint32_t seed, const Channel& medium) : rng{seed}, channel{medium} {}

  Robot& add(std::uint16_t agent, std::uint32_t epoch, const LinkProfile& profile, double budget,
             const SyncConfig& config = {}) {
    robots.push_back(std::make_unique<Robot>(Life{agent, epoch}, profile, budget, now, config));
    return *robots.back();
  }
  /// Whether a hears b.
  std::function<bool(const Robot& a, const Robot& b)> connected = [](const Robot&, const Robot&) {
    return true;
  };

  RecordKey make_delta(Robot& robot, bool closure = false) {
    DeltaPose delta = random_delta(rng, robot.life.agent, robot.life.epoch, robot.next_seq);
    if (closure) delta.kind = DeltaPose::Kind::kClosure;
    const auto record = quantise(delta, robot.life.agent, robot.life.epoch,
                                 closure ? robot.next_closure_seq++ : robot.next_seq++);
    EXPECT_TRUE(record && robot.node.put(*record, now));
    robot.taker.delta_poses.emplace(record->key, *record);
    made[record->key] = now;
    return record->key;
  }
  void make_maplet(Robot& robot, std::size_t bytes, float saliency = 0.5F) {
    std::vector<std::byte> data(bytes);
    for (auto& byte : data) byte = static_cast<std::byte>(rng());
    const std::uint32_t crc = crc32c(std::span{data}.first(bytes - 4));
    for (std::size_t i = 0; i < 4; ++i) data[bytes - 4 + i] = static_cast<std::byte>(crc >> 8 * i);
    const MapletKey key{robot.life.agent, robot.life.epoch, robot.next_maplet++};
    EXPECT_TRUE(robot.node.put(key, data, saliency, now));
    robot.taker.maplets.emplace(key, data);
  }

  void run(Duration time, const std::function<void()>& each_step = {}) {
    for (const Instant end = now + time; now < end; now += kStep) {
      if (each_step) each_step();
      deliver();
      for (auto& robot : robots) send(*robot);
    }
  }
  /// The robot is about to be replaced: what is on its way to it is lost.
  void forget(const Robot& robot) {
    std::erase_if(flights_, [&](const Flight& flight) { return flight.to == &robot; });
  }
  [[nodiscard]] bool same_records() const {
    return std::ranges::all_of(robots, [&](const auto& robot) {
      return robot->node.ledger().records_digest() == robots[0]->node.ledger().records_digest();
    });
  }
  /// Seconds until all hold the same, or -1.
  double run_until_same(Duration limit) {
    const Instant start = now;
    while (now - start < limit) {
      run(kStep * 5);
      if (same_records()) return seconds(now - start);
    }
    return -1.0;
  }

  Instant now{std::chrono::hours{1}};
  std::mt19937 rng;
  Channel channel;
  std::vector<std::unique_ptr<Robot>> robots;
  std::map<RecordKey, Instant> made;

 private:
  struct Flight {
    Instant at;
    const Robot* from;
    Robot* to;
    std::vector<std::byte> bytes;
  };

  void send(Robot& robot) {
    const std::size_t most = robot.datagram_bytes + kWireOverhead;
    robot.budget.set_apart(robot.node.somebody_away(now));
    while (robot.budget.allows(most, now, false)) {
      const ExchangeNode::Outgoing out = robot.node.next(now, robot.budget.allows(most, now));
      if (out.bytes.empty()) return;
      const std::size_t wire = out.bytes.size() + kWireOverhead;
      robot.budget.charge(wire, now);
      robot.sent_bytes += wire;
      robot.sent.emplace_back(now, wire);
      const auto air = Duration{
          static_cast<Duration::rep>(1e9 * static_cast<double>(wire) / channel.bytes_per_s)};
      free_at_ = std::max(free_at_, now) + air;
      for (auto& other : robots) {
        if (other.get() == &robot || !connected(*other, robot) || lost()) continue;
        flights_.push_back(
            {free_at_ + channel.delay, &robot, other.get(), {out.bytes.begin(), out.bytes.end()}});
      }
    }
  }
  bool lost() {
    std::uniform_real_distribution<double> unit{0.0, 1.0};
    losing_ = unit(rng) < (losing_ && channel.burst > 0.0 ? channel.burst : channel.loss);
    return losing_;
  }
  void deliver() {
    std::vector<Flight> due;
    for (auto it = flights_.begin(); it != flights_.end();) {
      if (it->at > now) {
        ++it;
        continue;
      }
      due.push_back(std::move(*it));
      it = flights_.erase(it);
    }
    for (const Flight& flight : due) {
      flight.to->taker.now = now;
      flight.to->node.receive(flight.bytes, now);
    }
  }

  std::deque<Flight> flights_;
  Instant free_at_{};
  bool losing_ = false;
};

}  // namespace maplet::test
