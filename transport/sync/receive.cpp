// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "transport/sync/node.hpp"

namespace maplet {

namespace {

constexpr Duration kSilence = std::chrono::seconds{6};  // after it a peer is heard "again"
constexpr Duration kSoon = std::chrono::milliseconds{50};
constexpr int kFlight = 4;  // of the quick intervals: what is not there by then is lost

bool touch(const KeyRange& a, const KeyRange& b) noexcept {
  return a.life == b.life && a.stream == b.stream && a.seqs.first < b.seqs.end &&
         b.seqs.first < a.seqs.end;
}

/// Equal contents; a delta-pose in either order of the covariance's numbers is the same bytes.
template <class Record>
bool same(const Record& a, const Record& b) noexcept {
  return a == b;
}

}  // namespace

void ExchangeNode::receive(std::span<const std::byte> bytes, Instant now) noexcept {
  ++counters_.datagrams_in;
  DatagramReader reader{bytes};
  if (reader.fault() == DatagramFault::kFuture) ++counters_.future;
  if (reader.fault() == DatagramFault::kDamaged) ++counters_.damaged;
  if (reader.fault() != DatagramFault::kNone) return;
  const DatagramHead& head = reader.head();
  if (head.sender == self_) {
    // The link gives nobody their own words back: a double with a copy of our journal, or what was
    // on its way when an earlier process of ours ended.
    if (now - woken_at_ > kStragglers) peers_.note_conflict(self_.agent);
    return;
  }
  if (head.sender.agent == self_.agent) peers_.note_conflict(self_.agent);
  const Peer* before = peers_.find(head.sender);
  const bool again = before == nullptr || now - before->last_heard > kSilence;
  if (again && lonely(now, kSilence)) forget_owed();
  Peer& peer = peers_.heard(head, bytes.size(), now);
  if (again && !(in_sync(peer) && before != nullptr)) say_by(now + kSoon + jitter(kSoon * 4));
  if (again) maplets_from_ = now + 5 * profile_.quick;  // records first

  RecordContext context{head.sender.agent, head.sender.epoch};
  bool readable = true;
  for (DatagramReader::Entry entry; reader.next(entry);) {
    take_entry(entry, peer, context, readable, now);
  }
  if (reader.broken()) ++counters_.malformed;
}

void ExchangeNode::take_entry(const DatagramReader::Entry& entry, Peer& peer,
                              RecordContext& context, bool& readable, Instant now) noexcept {
  ByteReader in{entry.body};
  switch (entry.kind) {
    case EntryKind::kDeltaPose:
    case EntryKind::kRange: {
      if (!readable) return;
      if (entry.kind == EntryKind::kDeltaPose) {
        const auto record = read_delta_pose(in, context);
        readable = record && in.left() == 0;
        if (readable) take_record(*record, delta_poses_, peer, now);
      } else {
        const auto record = read_range(in, context);
        readable = record && in.left() == 0;
        if (readable) take_record(*record, ranges_, peer, now);
      }
      if (!readable) ++counters_.malformed;  // and those after it, which lean on it
      return;
    }
    case EntryKind::kBeacon:
      return take_beacon(entry.body, peer, now);
    case EntryKind::kDigest:
      return take_digest(entry.body, peer, now);
    case EntryKind::kRequest:
      return take_request(entry.body, now);
    case EntryKind::kMapletOffer:
      if (const auto offer = read_offer(entry.body)) {
        trade_.heard_offer(*offer, peer.life.agent, now);
      } else {
        ++counters_.malformed;
      }
      return;
    case EntryKind::kMapletRequest:
      if (const auto request = read_maplet_request(entry.body)) {
        if (request->holder == self_.agent) trade_.heard_request(*request);
      } else {
        ++counters_.malformed;
      }
      return;
    case EntryKind::kMapletChunk:
      if (const auto chunk = read_chunk(entry.body)) {
        (void)trade_.heard_chunk(*chunk, peer.life.agent, taker_, now);
      } else {
        ++counters_.malformed;
      }
      return;
  }
  ++counters_.unknown;
}

template <class Record>
void ExchangeNode::take_record(const Record& record, RecordRing<Record>& ring, Peer& peer,
                               Instant now) noexcept {
  const Life life{record.key.agent, record.key.epoch};
  flow_at_ = came_at_ = now;
  if (ledger_.contains(record.key)) {
    ++counters_.duplicates;
    const auto* slot = ring.find(record.key);
    if (slot != nullptr && !same(slot->record, record)) {
      ++counters_.conflicting;
      peers_.note_conflict(record.key.agent);
    }
    return;
  }
  if (is_new_own(life, record.key.stream, record.key.seq)) {
    ++counters_.forged_own;
    peers_.note_conflict(self_.agent);
    return;
  }
  if (!ledger_.accepts(record.key) || !taker_.take(record)) {
    ++counters_.refused;
    return;
  }
  (void)ledger_.insert(record.key);
  ring.put(record);
  ++counters_.received;
  ++peer.new_records;
  changed(now);
  say_by(now + profile_.quick / 2 + jitter(profile_.quick / 4));
  const SeqSet& held = ledger_.find(life)->held[static_cast<std::size_t>(record.key.stream)];
  if (held.next() < record.key.seq) {
    held.missing({held.next(), record.key.seq}, [&](const SeqRange& gap) {
      want({life, record.key.stream, gap}, peer.life.agent, now + kSoon * 2, peer.life.agent);
    });
  }
}

void ExchangeNode::take_beacon(std::span<const std::byte> body, Peer& peer, Instant now) noexcept {
  const auto beacon = read_beacon(body);
  if (!beacon) {
    ++counters_.malformed;
    return;
  }
  const bool was_same = in_sync(peer);
  peer.has_word = true;
  peer.word = beacon->word;
  peer.word_at = now;
  if (!beacon->brief) {
    peer.records = beacon->records;
    peer.last_clock = beacon->clock;
    peer.last_clock_at = now;
  }
  for (const Beacon::Echo& echo : beacon->echoes) {
    if (echo.agent != self_.agent) continue;
    const Stamp ours = record_clock(now);
    const auto ours_us = static_cast<std::uint64_t>(ours.count() / 1000);
    const auto age_us = static_cast<std::uint32_t>(ours_us) - echo.clock_us;
    note_clocks(peer, ours - std::chrono::microseconds{age_us},
                std::chrono::microseconds{echo.held_us}, peer.last_clock, ours, now);
  }
  if (in_sync(peer)) {
    // It cannot know that we hold the same, unless it says so.
    if (!was_same && !beacon->brief && !beacon->same_answered) say_by(now + profile_.quick / 2);
  } else {
    say_by(std::max(now + kSoon + jitter(kSoon), said_at_ + profile_.quick / 2));
  }
}

void ExchangeNode::take_digest(std::span<const std::byte> body, Peer& peer, Instant now) noexcept {
  ByteReader in{body};
  std::optional<std::uint16_t> heard;
  const std::uint64_t there = in.fixed(1);
  for (std::uint64_t count = there; count > 0 && in.ok(); --count) {
    const std::uint64_t agent = in.varint_to(0xFFFF);
    const auto next = static_cast<std::uint16_t>(in.fixed(2));
    if (agent == self_.agent) heard = next;
  }
  const auto difference = read_digest(in.bytes(in.left()), ledger_);
  if (!in.ok() || !difference) {
    ++counters_.malformed;
    return;
  }
  bool they_miss = false;
  const bool alone = alone_with(peer, now);  // as our own digest will tell it
  for (const KeyRange& range : difference->i_lack) {
    if (is_new_own(range.life, range.stream, range.seqs.first)) continue;  // of a double; or forged
    if (range.stream == Stream::kMaplets) {
      trade_.heard_holding(range, peer.life.agent, now);
    } else {
      // Alone with us it sends all that we lack, once it has our digest.
      want(range, author_or(range.life, peer, now), alone ? now + 2 * profile_.quick : now,
           peer.life.agent, alone);
    }
  }
  for (const KeyRange& range : difference->they_lack) {
    if (range.stream == Stream::kMaplets) continue;
    if (range.life == self_) {
      owe_lost(range, heard, now);  // nobody else volunteers
    } else if (heard && there == 1) {
      owe_lost(range, heard, now);  // nobody else could
    } else {
      they_miss = true;
    }
  }
  // They ask, once they know what we have.
  if (they_miss) say_by(std::max(now + kSoon + jitter(kSoon), said_at_ + profile_.quick / 2));
}

void ExchangeNode::take_request(std::span<const std::byte> body, Instant now) noexcept {
  ByteReader in{body};
  const auto holder = in.varint_to(0xFFFF);
  const auto heard = static_cast<std::uint16_t>(in.fixed(2));
  const auto ranges = read_ranges(in.bytes(in.left()));
  if (!in.ok() || !ranges) {
    ++counters_.malformed;
    return;
  }
  if (holder != self_.agent) return;
  for (const KeyRange& range : *ranges) {
    const Ledger::Row* row = ledger_.find(range.life);
    if (row == nullptr || range.stream == Stream::kMaplets) continue;
    row->held[static_cast<std::size_t>(range.stream)].held([&](const SeqRange& held) {
      const SeqRange both{std::max(held.first, range.seqs.first),
                          std::min(held.end, range.seqs.end)};
      if (both.first < both.end) owe_lost({range.life, range.stream, both}, heard, now);
    });
  }
}

// Whoever made the records and is heard gives them unasked; two that send them are one too many.
std::uint16_t ExchangeNode::author_or(const Life& author, const Peer& peer,
                                      Instant now) const noexcept {
  return recently_heard(author, now) ? author.agent : peer.life.agent;
}

void ExchangeNode::want(const KeyRange& range, std::uint16_t holder, Instant due,
                        std::uint16_t other_holder, bool unasked) noexcept {
  for (Want& other : wants_) {
    if (!touch(other.range, range)) continue;
    if (other.tries >= 2) other.holder = other_holder;  // the first one does not answer
    // The same gap and more: ask for all of it.
    other.range.seqs.first = std::min(other.range.seqs.first, range.seqs.first);
    other.range.seqs.end = std::max(other.range.seqs.end, range.seqs.end);
    return;
  }
  if (!full(wants_)) wants_.push_back({range, holder, due, 0, unasked});
}

void ExchangeNode::owe(const KeyRange& range) noexcept {
  Ranges& owed = owed_[static_cast<std::size_t>(range.stream)];
  for (KeyRange& other : owed) {
    if (other.life != range.life || other.stream != range.stream) continue;
    if (range.seqs.first > other.seqs.end || other.seqs.first > range.seqs.end) continue;
    other.seqs.first = std::min(other.seqs.first, range.seqs.first);
    other.seqs.end = std::max(other.seqs.end, range.seqs.end);
    return;
  }
  if (!full(owed)) owed.push_back(range);
}

void ExchangeNode::owe_lost(const KeyRange& range, std::optional<std::uint16_t> heard,
                            Instant now) noexcept {
  const auto on_its_way = [&](const auto* slot) {
    return slot != nullptr && slot->sent != Instant{} &&
           now - slot->sent < kFlight * profile_.quick &&
           static_cast<std::int16_t>(slot->count - *heard) >= 0;
  };
  KeyRange lost = range;
  for (std::uint32_t seq = range.seqs.first; heard && seq < range.seqs.end; ++seq) {
    const RecordKey key{range.life.agent, range.life.epoch, range.stream, seq};
    if (!(range.stream == Stream::kRanges ? on_its_way(ranges_.find(key))
                                          : on_its_way(delta_poses_.find(key))))
      continue;
    lost.seqs.end = seq;
    if (lost.seqs.first < seq) owe(lost);
    lost.seqs = {seq + 1, range.seqs.end};
  }
  if (lost.seqs.first < lost.seqs.end) owe(lost);
}

void ExchangeNode::changed(Instant now) noexcept {
  changed_at_ = now;
  calm_ = profile_.quick;
}

}  // namespace maplet
