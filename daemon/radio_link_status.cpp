// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What the link tells of itself.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "daemon/log.hpp"
#include "daemon/radio_link.hpp"
#include "transport/dds/wire_meter.hpp"

namespace maplet::daemon {

namespace {

using namespace std::chrono_literals;

constexpr Duration kRest = 3s;      // nothing new for so long: at rest
constexpr Duration kPresent = 20s;  // heard within: there

}  // namespace

void RadioLink::note_status(Instant now) noexcept {
  noted_at_ = now;
  const bool busy = !node_->settled(now) || node_->trading(now) ||
                    delta_poses_in_.read_available() > 0 || maplets_in_.read_available() > 0;
  const auto present = [&](const Peer& peer) { return now - peer.last_heard < kPresent; };
  const bool company = std::ranges::any_of(node_->peers(), present);
  if ((touched_.exchange(false) || busy) && company) busy_at_ = now;
  // When silence ends, they are soon heard, or nobody is there.
  if (node_->silent()) busy_at_ = now + (kPresent - kRest);
  at_rest_ = now - busy_at_ > kRest;

  records_digest_ = node_->ledger().records_digest();
  settled_ = node_->settled(now);

  const std::scoped_lock lock{mutex_};
  RadioStatus& s = status_;
  s.open = open_;
  s.silent = node_->silent();
  s.settled = node_->settled(now);
  s.listeners = listeners_;
  s.records = node_->ledger().records();
  s.records_digest = node_->ledger().records_digest();
  s.missing = node_->ledger().missing();
  const auto held_of = [&](const Life& life) {
    std::array<std::uint32_t, kStreams> held{};
    const Ledger::Row* row = node_->ledger().find(life);
    for (std::size_t i = 0; row != nullptr && i < kStreams; ++i) held[i] = row->held[i].next();
    return held;
  };
  s.own = held_of(node_->self());
  s.wire_bytes = wire_bytes_;
  s.dds_bytes = dds_bytes_;
  s.held_back = WireMeter::held_back;
  s.window_bytes = budget_.window_bytes(now);
  s.lane_bytes = lane_bytes_;
  s.conflicts = static_cast<std::uint32_t>(node_->peer_table().conflicts());
  s.conflicting_agent = node_->peer_table().conflicting_agent().value_or(0xFFFF);
  if (s.conflicts == 0) s.conflicting_agent = -1;
  s.lives_refused = node_->ledger().lives_refused();
  s.counters = node_->counters();
  if (security_) s.security = security_->status();
  s.security.sealed_heard = sealed_heard_;
  s.security.refused_by_dds = strangers_before_ + strangers_;
  s.maplets = node_->maplets().counters();
  s.peer_count = 0;
  for (const bool ended : {false, true}) {  // those that live first
    for (const Peer& peer : node_->peers()) {
      if (s.peer_count == RadioStatus::kMaxPeers) break;
      if (peer.superseded != ended) continue;
      auto& out = s.peers[s.peer_count++];
      out.peer = peer;
      out.in_sync = node_->in_sync(peer);
      out.silent_s = seconds(now - peer.last_heard);
      out.held_of = held_of(peer.life);
    }
  }
}

// What an operator has to hear of, whoever looks at the status or not.
void RadioLink::warn_once() noexcept {
  const Peers& peers = node_->peer_table();
  if (peers.conflicts() > 0 && !std::exchange(warned_.conflict, true)) {
    log_warning(
        fmt::format("exchange: two devices call themselves agent {}: give each its own "
                    "--agent, and its own state directory",
                    peers.conflicting_agent().value_or(0)));
  }
  if (node_->ledger().lives_refused() > 0 && !std::exchange(warned_.lives, true)) {
    log_warning(
        "exchange: more agents and restarts are known than exchange.max_lives allows: the "
        "records of further ones are not taken; raise it");
  }
  if (sealed_heard_ > 0 && !std::exchange(warned_.sealed, true)) {
    log_warning("security: a secured team is heard, and this agent has no keys (security.mode)");
  }
  if (const std::uint64_t all = strangers_before_ + strangers_; all > warned_.strangers) {
    warned_.strangers = all;
    log_warning(fmt::format("security: DDS Security kept {} participants out so far", all));
  }
  if (node_->counters().future > 0 && !std::exchange(warned_.future, true)) {
    log_warning("exchange: an agent speaks a newer version, which is left alone: update mapletd");
  }
}

std::optional<Duration> RadioLink::clock_offset(std::uint16_t agent) const noexcept {
  const std::unique_lock lock{mutex_, std::try_to_lock};
  for (std::size_t i = 0; lock && i < status_.peer_count; ++i) {
    const Peer& peer = status_.peers[i].peer;
    if (peer.life.agent == agent && !peer.superseded && peer.has_offset) return peer.clock_offset;
  }
  return {};
}

RadioStatus RadioLink::status() const {
  const std::scoped_lock lock{mutex_};
  return status_;
}

}  // namespace maplet::daemon
