// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What the daemon says of itself.
#include <chrono>

#include "daemon/app.hpp"
#include "daemon/memory_status.hpp"

namespace maplet::daemon {

using namespace std::chrono_literals;

void App::publish_status(StatusRecord::State state) {
  last_status_ = flight_.now();
  const StatusRecord record = status(state);
  const auto us = [this](double share) {
    return static_cast<std::uint32_t>(latency_.percentile(share) / 1us);
  };
  const StageTime latency{us(0.5), us(0.99), static_cast<std::uint32_t>(latency_.max() / 1us), 0};
  const std::uint64_t held = radio_ ? radio_->records_digest() : 0;  // before settled is asked
  std::array<ToldHistogram, kStages> wall;
  for (std::size_t i = 0; i < kStages; ++i) wall[i] = meters_.of(static_cast<Stage>(i)).wall.told();
  const MapletStore& own = agent_->maplets();
  fills_.own_maplets.note(own.count() - own.forgotten(),
                          static_cast<std::uint64_t>(config_.agent.limits.own_maplets));
  fills_.nodes.note(record.nodes, static_cast<std::uint64_t>(config_.agent.skeleton.max_nodes));
  fills_.factors.note(record.factors,
                      static_cast<std::uint64_t>(config_.agent.skeleton.max_factors));
  board_.note({record, latency, agent_->settled() && (!radio_ || radio_->settled()),
               agent_->skeleton().records_digest(), held, agent_->range_counters(),
               agent_->map_frame(), free_, agent_->tracking(), wall, fills_});
  if (publisher_) (void)publisher_->publish(record);
}

StatusRecord App::status(StatusRecord::State state) const {
  StatusRecord status;
  status.agent = identity_.agent;
  status.epoch = identity_.epoch;
  status.state = state;
  status.tracking = tracking_;
  status.stamp = last_stamp_;
  status.uptime_ms = static_cast<std::uint64_t>((last_status_ - start_) / 1ms);
  const SourceCounters source = source_counters();
  status.frames_read = source.read;
  status.frames_processed = totals_.processed;
  status.frames_dropped = source.dropped + totals_.dropped;
  status.frames_lost = totals_.lost;
  status.keyframes = totals_.keyframes;
  status.maplets = totals_.maplets;
  status.delta_poses = totals_.delta_poses;
  status.closures = totals_.closures;
  status.nodes = static_cast<std::uint32_t>(agent_->skeleton().node_count());
  status.factors = static_cast<std::uint32_t>(agent_->skeleton().factor_count());
  status.messages_dropped =
      publisher_ ? static_cast<std::uint32_t>(publisher_->counters().dropped) : 0;
  status.arena_bytes = arena_.used_bytes();
  status.rss_bytes = peak_rss_bytes();
  for (std::size_t i = 0; i < kStages; ++i)
    status.stages[i] = meters_.summary(static_cast<Stage>(i));
  return status;
}

}  // namespace maplet::daemon
