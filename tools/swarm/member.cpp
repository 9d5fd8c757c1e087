// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/swarm/member.hpp"

namespace maplet::swarm {

namespace {

constexpr std::size_t kMapletBytes = 4096;
constexpr Duration kAdding = std::chrono::microseconds{100};  // a frame leaves no more for it

LinkProfile profile_of(const SwarmConfig& config) {
  return config.profile == "radio" ? radio_profile() : wifi_profile();
}

SyncConfig exchange_of(const SwarmConfig& config, int records) {
  SyncConfig exchange;
  exchange.max_lives = std::max(2, config.agents);
  exchange.records_kept = std::max(16, records);
  exchange.ranges_kept = 16;
  exchange.maplets_kept = 1;  // none are exchanged
  exchange.maplets = "none";
  return exchange;
}

}  // namespace

Member::Member(const SwarmConfig& config, Life life, int records, int maplets, Instant now)
    : profile_{profile_of(config)},
      node_{exchange_of(config, records), profile_, kMapletBytes, life, *this, arena_},
      budget_{config.budget_bytes_per_s, profile_.datagram_bytes + kWireOverheadBytes, now} {
  if (maplets == 0) return;
  SkeletonConfig skeleton;
  skeleton.max_nodes = maplets;
  skeleton.max_factors = records + 16;
  skeleton.condense = false;
  skeleton_arena_.emplace();
  skeleton_ = skeleton_arena_->make<Skeleton>("skeleton", skeleton, *skeleton_arena_);
}

std::optional<DeltaPoseRecord> Member::make(const DeltaPose& delta, Instant now) {
  const Life self = node_.self();
  const auto stream = static_cast<std::size_t>(stream_of(delta.kind));
  const auto record = quantise(delta, self.agent, self.epoch, seqs_[stream]);
  if (!record || !node_.put(*record, now)) return {};
  ++seqs_[stream];
  (void)take(*record);
  return *record;
}

bool Member::take(const DeltaPoseRecord& record) noexcept {
  static const MonotonicClock clock;
  if (skeleton_) (void)skeleton_->add(restore(record), Deadline{clock, kAdding});
  return true;
}

}  // namespace maplet::swarm
