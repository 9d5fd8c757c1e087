// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "transport/sync/node.hpp"

namespace maplet {

namespace {

constexpr int kMaxTries = 6;
constexpr std::size_t kMostHeard = 8;                   // are told of in a digest
constexpr Duration kClocks = std::chrono::seconds{20};  // are told so often
constexpr int kMaxSkips = 512;  // records no longer kept, looked up in one call

}  // namespace

Waiting ExchangeNode::waiting(Instant now, bool bulk) noexcept {
  Waiting waiting;
  if (!owed_[0].empty()) waiting.set(Traffic::kDeltaPoses);
  if (!owed_[1].empty()) waiting.set(Traffic::kClosures);
  if (!owed_[2].empty()) waiting.set(Traffic::kRanges);
  if (now >= say_at_ || requests_due(now) || trade_.offers() ||
      (now >= maplets_from_ && trade_.wants(taker_, now))) {
    waiting.set(Traffic::kControl);
  }
  if (bulk && trade_.owes() && now >= maplets_from_) waiting.set(Traffic::kMaplets);
  return waiting;
}

ExchangeNode::Outgoing ExchangeNode::next(Instant now, bool bulk) noexcept {
  trade_.hand_over(taker_, [&](const MapletKey& key) {
    (void)ledger_.insert({key.agent, key.epoch, Stream::kMaplets, key.id});
  });
  if (silent_) return {};
  say_again(now);
  for (std::size_t i = 0; i < kTraffics; ++i) {  // what turns out to be nothing does not count
    const auto first = scheduler_.pick(waiting(now, bulk));
    if (!first) return {};
    DatagramWriter out{std::span{buffer_}.first(profile_.datagram_bytes), {self_, count_}};
    RecordContext context{self_.agent, self_.epoch};
    fill(out, context, *first, now);
    if (profile_.mixed && *first != Traffic::kMaplets) {
      for (const Traffic more :
           {Traffic::kDeltaPoses, Traffic::kClosures, Traffic::kRanges, Traffic::kControl}) {
        if (more != *first && waiting(now, bulk).has(more)) fill(out, context, more, now);
      }
    }
    if (out.empty()) continue;
    // Whoever hears news also hears what we hold now.
    if (*first != Traffic::kMaplets && *first != Traffic::kControl) write_beacon(out, true, now);
    ++count_;
    ++counters_.datagrams_out;
    return {*first, out.finish()};
  }
  return {};
}

bool ExchangeNode::fill(DatagramWriter& out, RecordContext& context, Traffic traffic,
                        Instant now) noexcept {
  const std::size_t before = out.size();
  bool any = false;
  switch (traffic) {
    case Traffic::kDeltaPoses:
      any = fill_records(out, context, owed_[0], delta_poses_, now);
      break;
    case Traffic::kClosures:
      any = fill_records(out, context, owed_[1], delta_poses_, now);
      break;
    case Traffic::kRanges:
      any = fill_records(out, context, owed_[2], ranges_, now);
      break;
    case Traffic::kControl:
      any = fill_control(out, now);
      break;
    case Traffic::kMaplets:
      while (trade_.write_chunk(out)) any = true;
      break;
  }
  scheduler_.charge(traffic, out.size() - before);
  return any;
}

template <class Record>
bool ExchangeNode::fill_records(DatagramWriter& out, RecordContext& context, Ranges& owed,
                                RecordRing<Record>& ring, Instant now) noexcept {
  constexpr EntryKind kKind =
      std::is_same_v<Record, RangeRecord> ? EntryKind::kRange : EntryKind::kDeltaPose;
  constexpr std::size_t kBeaconRoom = 16;
  bool any = false;
  int skips = 0;
  while (!owed.empty()) {
    KeyRange& range = owed.front();
    for (; range.seqs.first < range.seqs.end; ++range.seqs.first) {
      auto* slot = ring.find({range.life.agent, range.life.epoch, range.stream, range.seqs.first});
      const bool just_sent =
          slot != nullptr && slot->sent != Instant{} && now - slot->sent < profile_.holdoff;
      if (slot == nullptr || just_sent) {
        if (++skips > kMaxSkips) return any;
        continue;
      }
      std::array<std::byte, kMaxRecordBytes> body;
      ByteWriter writer{body};
      RecordContext after = context;
      write_record(writer, after, slot->record);
      if (out.room() < writer.size() + kBeaconRoom ||
          !out.add(kKind, std::span{body}.first(writer.size()))) {
        return any;
      }
      context = after;
      slot->sent = now;
      slot->count = count_;
      flow_at_ = now;
      any = true;
    }
    owed.erase(owed.begin());
  }
  return any;
}

bool ExchangeNode::fill_control(DatagramWriter& out, Instant now) noexcept {
  bool any = write_requests(out, now);
  while (trade_.write_offer(out)) any = true;
  while (now >= maplets_from_ && trade_.write_request(out, taker_, now)) any = true;
  if (now < say_at_) return any;
  if (!small_digest() && records_flow(now)) {
    say_at_ = now + profile_.quick / 4;
    return any;
  }
  const bool told = full_beacon_at_ >= changed_at_ && now - full_beacon_at_ < kClocks;
  const bool brief = lonely(now, kThere) || (told && !recent_peer_behind(now, kThere));
  if (!brief) full_beacon_at_ = now;
  any = write_beacon(out, brief, now) || any;
  if (digest_after_ || digest_wanted(now)) {
    any = write_digest_entry(out, now) || any;
    digest_at_ = now;
  }
  said_at_ = now;
  say_at_ = now + (digest_after_ ? profile_.quick / 4 : interval(now) + jitter(profile_.quick / 4));
  return any;
}

bool ExchangeNode::write_requests(DatagramWriter& out, Instant now) noexcept {
  for (std::size_t i = 0; i < wants_.size();) {
    Want& want = wants_[i];
    const SeqRange missing = still_missing(want.range);
    if (missing.first > want.range.seqs.first) want.tries = 0;  // the holder answers
    want.range.seqs.first = missing.first;
    const bool over = missing.first >= missing.end || want.tries >= kMaxTries;
    if (over || !heard_within(want.holder, kThere, now)) {
      wants_.erase(wants_.begin() + static_cast<std::ptrdiff_t>(i));
    } else {
      ++i;
    }
  }
  bool any = false;
  const bool being_sent = now - came_at_ < profile_.quick;
  for (Want& first : wants_) {
    if (now < first.due) continue;
    if (being_sent && first.unasked) {
      first.due = now + profile_.quick;
    } else {
      any = write_request(out, first.holder, now) || any;
    }
  }
  return any;
}

// Everything due that one holder has, as far as it fits.
bool ExchangeNode::write_request(DatagramWriter& out, std::uint16_t holder, Instant now) noexcept {
  std::array<std::byte, kMaxDatagramBytes> body;
  ByteWriter writer{std::span{body}.first(std::min(out.room(), body.size()))};
  writer.varint(holder);
  writer.fixed(heard_of(holder), 2);
  if (!writer.ok()) return false;
  bool any = false;
  for (Want& want : wants_) {
    if (want.holder != holder || now < want.due) continue;
    std::size_t written = 0;
    if (write_ranges({&want.range, 1}, std::span{body}.subspan(writer.size(), writer.room()),
                     written) == 0)
      break;
    writer.skip(written);
    want.due = now + profile_.again * (3 + want.tries) / 4 + jitter(profile_.quick / 4);
    ++want.tries;
    any = true;
  }
  return any && out.add(EntryKind::kRequest, std::span{body}.first(writer.size()));
}

SeqRange ExchangeNode::still_missing(const KeyRange& range) const noexcept {
  SeqRange missing{range.seqs.end, range.seqs.end};
  if (const Ledger::Row* row = ledger_.find(range.life)) {
    row->held[static_cast<std::size_t>(range.stream)].missing(range.seqs, [&](const SeqRange& gap) {
      missing.first = std::min(missing.first, gap.first);
    });
  }
  return missing;
}

// Up to which of their datagrams we heard those who are there: what they sent since is on its way.
void ExchangeNode::write_heard(ByteWriter& out, Instant now) const noexcept {
  StaticVector<const Peer*, kMostHeard> there;
  for (const Peer& peer : peers_.all())
    if (!full(there) && !peer.superseded && now - peer.last_heard < kThere) there.push_back(&peer);
  out.fixed(there.size(), 1);
  for (const Peer* peer : there) {
    out.varint(peer->life.agent);
    out.fixed(peer->next_count, 2);
  }
}

std::uint16_t ExchangeNode::heard_of(std::uint16_t agent) const noexcept {
  for (const Peer& peer : peers_.all())
    if (peer.life.agent == agent && !peer.superseded) return peer.next_count;
  return 0;
}

bool ExchangeNode::write_digest_entry(DatagramWriter& out, Instant now) noexcept {
  std::array<std::byte, kMaxDatagramBytes> body;
  std::size_t written = 0;
  ByteWriter writer{std::span{body}.first(std::min(out.room(), body.size()))};
  write_heard(writer, now);
  if (!writer.ok()) return false;
  const std::size_t head = writer.size();
  digest_after_ =
      write_digest(ledger_, digest_after_, std::span{body}.subspan(head, writer.room()), written);
  return written > 0 && out.add(EntryKind::kDigest, std::span{body}.first(head + written));
}

bool ExchangeNode::write_beacon(DatagramWriter& out, bool brief, Instant now) noexcept {
  Beacon beacon;
  beacon.word = word();
  beacon.brief = brief;
  beacon.same_answered = all_in_sync(now);
  beacon.records = static_cast<std::uint32_t>(ledger_.records());
  beacon.clock = record_clock(now);
  for (const Peer& peer : peers_.all()) {
    if (brief || !fresh(now) || full(beacon.echoes)) break;
    const Duration held = now - peer.last_clock_at;
    if (peer.superseded || held > std::chrono::seconds{20}) continue;
    const auto clock_us = static_cast<std::uint64_t>(peer.last_clock.count() / 1000);
    beacon.echoes.push_back({peer.life.agent, static_cast<std::uint32_t>(clock_us),
                             static_cast<std::uint32_t>(held.count() / 1000)});
  }
  std::array<std::byte, 64> body;
  ByteWriter writer{body};
  write(writer, beacon);
  return writer.ok() && out.add(EntryKind::kBeacon, std::span{body}.first(writer.size()));
}

}  // namespace maplet
