// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/sync/peers.hpp"

#include <algorithm>

namespace maplet {

namespace {

constexpr std::uint16_t kMostLost = 1000;  // a larger gap is a restart of the count, not loss
constexpr Duration kClockAge = std::chrono::seconds{60};

}  // namespace

Peer* Peers::find(const Life& life) noexcept {
  for (Peer& peer : all()) {
    if (peer.life == life) return &peer;
  }
  return nullptr;
}

Peer& Peers::add(const Life& life, Instant now) noexcept {
  Peer* place = nullptr;
  if (count_ < peers_.size()) {
    place = &peers_[count_++];
  } else {
    place = &*std::min_element(peers_.begin(), peers_.end(), [](const Peer& a, const Peer& b) {
      return a.last_heard < b.last_heard;
    });
  }
  *place = Peer{};
  place->life = life;
  place->first_heard = now;
  for (Peer& other : all()) {
    if (other.life.agent == life.agent && other.life != life) other.superseded = true;
  }
  return *place;
}

Peer& Peers::heard(const DatagramHead& head, std::size_t bytes, Instant now) noexcept {
  Peer* peer = find(head.sender);
  if (peer == nullptr) {
    peer = &add(head.sender, now);
  } else {
    const auto gap = static_cast<std::uint16_t>(head.count - peer->next_count);
    if (gap < kMostLost) peer->lost += gap;
    if (peer->superseded) {
      // An ended life does not speak again, but for what was on its way.
      Instant successor{};
      for (const Peer& other : all()) {
        if (other.life.agent == head.sender.agent && other.life != head.sender) {
          successor = std::max(successor, other.first_heard);
        }
      }
      if (now - successor > kStragglers) note_conflict(head.sender.agent);
    }
  }
  peer->next_count = static_cast<std::uint16_t>(head.count + 1);
  peer->last_heard = now;
  ++peer->datagrams;
  peer->bytes += bytes;
  return *peer;
}

void note_clocks(Peer& peer, Stamp sent, Duration held, Stamp theirs, Stamp ours,
                 Instant now) noexcept {
  const Duration delay = ours - sent - held;
  if (delay < Duration{0}) return;  // a clock was set in between
  const bool stale = now - peer.offset_at > kClockAge;
  if (peer.has_offset && !stale && delay >= peer.delay) return;
  peer.has_offset = true;
  peer.delay = delay;
  peer.clock_offset = theirs - ours + delay / 2;
  peer.offset_at = now;
}

}  // namespace maplet
