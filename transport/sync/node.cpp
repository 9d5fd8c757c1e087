// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/sync/node.hpp"

#include <algorithm>

namespace maplet {

namespace {

constexpr Duration kFresh = std::chrono::seconds{60};   // a change is news for so long
constexpr Duration kNear = std::chrono::seconds{150};   // a peer unheard for longer is far away
constexpr Duration kAlive = std::chrono::seconds{600};  // and then gone
constexpr Duration kThere = std::chrono::seconds{10};   // a peer that hears us, most likely
constexpr Duration kHeard = std::chrono::seconds{3};    // a peer that hears our digests now
constexpr int kMaxTries = 6;
constexpr int kRepeats = 2;
constexpr int kMaxSkips = 512;  // records no longer kept, looked up in one call

MapletTrade::Config trade_config(const SyncConfig& config, const LinkProfile& profile,
                                 std::size_t maplet_bytes) noexcept {
  return {static_cast<std::size_t>(config.maplets_kept),
          std::max<std::size_t>(1024, 2 * static_cast<std::size_t>(config.maplets_kept)),
          config.expected_maplet_bytes, maplet_bytes, 3 * profile.quick};
}

}  // namespace

ExchangeNode::ExchangeNode(const SyncConfig& config, const LinkProfile& profile,
                           std::size_t maplet_bytes, Life self, RecordTaker& taker, Arena& arena)
    : config_{config},
      profile_{profile},
      self_{self},
      taker_{taker},
      ledger_{{config.max_lives}, arena},
      delta_poses_{static_cast<std::size_t>(config.records_kept), "exchange/records", arena},
      ranges_{static_cast<std::size_t>(config.ranges_kept), "exchange/ranges", arena},
      trade_{trade_config(config, profile, maplet_bytes), arena},
      peers_{static_cast<std::size_t>(config.max_lives), arena},
      calm_{profile.quick},
      random_{(std::uint64_t{self.agent} << 32 | self.epoch) | 1U} {}

Duration ExchangeNode::jitter(Duration most) noexcept {
  random_ ^= random_ << 13;
  random_ ^= random_ >> 7;
  random_ ^= random_ << 17;
  return Duration{static_cast<Duration::rep>(
      random_ % static_cast<std::uint64_t>(std::max<Duration::rep>(most.count(), 1)))};
}

bool ExchangeNode::put(const DeltaPoseRecord& record, Instant now) noexcept {
  if (Life{record.key.agent, record.key.epoch} != self_) return false;
  if (ledger_.insert(record.key) != Insert::kNew) return false;
  delta_poses_.put(record);
  say_news(record.key, now);
  return true;
}

bool ExchangeNode::put(const RangeRecord& record, Instant now) noexcept {
  if (Life{record.key.agent, record.key.epoch} != self_) return false;
  if (ledger_.insert(record.key) != Insert::kNew) return false;
  ranges_.put(record);
  say_news(record.key, now);
  return true;
}

bool ExchangeNode::put(const MapletKey& key, std::span<const std::byte> bytes, float saliency,
                       Instant now) noexcept {
  const auto steps = static_cast<std::uint8_t>(std::clamp(saliency, 0.0F, 1.0F) * 255.0F);
  if (!trade_.keep(key, bytes, steps)) return false;
  (void)ledger_.insert({key.agent, key.epoch, Stream::kMaplets, key.id});
  say_by(now + profile_.quick);
  return true;
}

void ExchangeNode::restore(const DeltaPoseRecord& record) noexcept {
  if (ledger_.insert(record.key) == Insert::kNew) delta_poses_.put(record);
}

void ExchangeNode::restore(const RangeRecord& record) noexcept {
  if (ledger_.insert(record.key) == Insert::kNew) ranges_.put(record);
}

void ExchangeNode::restore(const MapletKey& key, std::span<const std::byte> bytes,
                           float saliency) noexcept {
  const auto steps = static_cast<std::uint8_t>(std::clamp(saliency, 0.0F, 1.0F) * 255.0F);
  if (!trade_.keep(key, bytes, steps)) return;
  trade_.skip_offers();
  (void)ledger_.insert({key.agent, key.epoch, Stream::kMaplets, key.id});
}

void ExchangeNode::restored(Stream stream, std::uint32_t end) noexcept {
  restored_[static_cast<std::size_t>(stream)] = end;
}

void ExchangeNode::say_news(const RecordKey& key, Instant now) noexcept {
  const KeyRange range{self_, key.stream, {key.seq, key.seq + 1}};
  owe(range);
  if (full(again_)) again_.erase(again_.begin());
  again_.push_back({range, now + profile_.again, kRepeats});
  changed(now);
  say_by(now + profile_.quick);
}

// On a link that loses much, saying it anew is quicker than finding out that it was lost.
void ExchangeNode::say_again(Instant now) noexcept {
  const bool unconfirmed = recent_peer_behind(now, kThere);
  for (std::size_t i = 0; i < again_.size();) {
    Again& news = again_[i];
    if (now >= news.due) {
      if (!unconfirmed || news.left-- <= 0) {
        again_.erase(again_.begin() + static_cast<std::ptrdiff_t>(i));
        continue;
      }
      owe(news.range);
      news.due = now + profile_.again;
    }
    ++i;
  }
}

void ExchangeNode::wake(Instant now) noexcept {
  changed(now);
  say_by(now + jitter(profile_.quick / 2));
}

bool ExchangeNode::recent_peer_behind(Instant now, Duration age) const noexcept {
  return std::ranges::any_of(peers_.all(), [&](const Peer& peer) {
    return !peer.superseded && now - peer.last_heard < age && !in_sync(peer);
  });
}

bool ExchangeNode::somebody_away(Instant now) const noexcept {
  return std::ranges::any_of(peers_.all(), [&](const Peer& peer) {
    const Duration silence = now - peer.last_heard;
    return !peer.superseded && silence > kThere && silence < kAlive;
  });
}

bool ExchangeNode::recently_heard(const Life& life, Instant now) const noexcept {
  return std::ranges::any_of(peers_.all(), [&](const Peer& peer) {
    return peer.life == life && !peer.superseded && now - peer.last_heard < kHeard;
  });
}

bool ExchangeNode::all_in_sync(Instant now) const noexcept {
  return !recent_peer_behind(now, kAlive);
}

bool ExchangeNode::settled(Instant now) const noexcept {
  return all_in_sync(now) && wants_.empty() &&
         std::ranges::all_of(owed_, [](const Ranges& owed) { return owed.empty(); });
}

bool ExchangeNode::trading(Instant now) noexcept {
  return trade_.owes() || trade_.offers() || trade_.wants(taker_, now);
}

bool ExchangeNode::fresh(Instant now) const noexcept { return now - changed_at_ < kFresh; }

bool ExchangeNode::lonely(Instant now, Duration age) const noexcept {
  return std::ranges::none_of(peers_.all(),
                              [&](const Peer& peer) { return now - peer.last_heard < age; });
}

/// Quick while something is unconfirmed and news, quickest with somebody who is heard; else ever
/// slower.
Duration ExchangeNode::interval(Instant now) noexcept {
  const bool fresh = this->fresh(now);
  if (fresh && recent_peer_behind(now, 4 * profile_.quick)) return profile_.quick / 2;
  if (fresh && recent_peer_behind(now, kNear)) return profile_.quick;
  if (fresh && recent_peer_behind(now, kAlive)) return 4 * profile_.quick;
  calm_ = std::min(2 * calm_, config_.idle_interval);
  return calm_;
}

bool ExchangeNode::requests_due(Instant now) const noexcept {
  return std::ranges::any_of(wants_, [&](const Want& want) { return now >= want.due; });
}

Instant ExchangeNode::due() const noexcept {
  if (trade_.owes() || trade_.offers()) return {};
  for (const Ranges& owed : owed_) {
    if (!owed.empty()) return {};
  }
  Instant due = say_at_;
  for (const Want& want : wants_) due = std::min(due, want.due);
  for (const Again& news : again_) due = std::min(due, news.due);
  return due;
}

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
  const bool same = all_in_sync(now);
  any = write_beacon(out, false, now) || any;
  if (!same) any = write_digest_entry(out) || any;
  said_at_ = now;
  say_at_ = now + (digest_after_ ? profile_.quick / 4 : interval(now) + jitter(profile_.quick / 4));
  return any;
}

bool ExchangeNode::write_requests(DatagramWriter& out, Instant now) noexcept {
  bool any = false;
  for (std::size_t i = 0; i < wants_.size();) {
    Want& want = wants_[i];
    const Ledger::Row* row = ledger_.find(want.range.life);
    SeqRange missing{want.range.seqs.end, want.range.seqs.end};
    if (row != nullptr) {
      row->held[static_cast<std::size_t>(want.range.stream)].missing(
          want.range.seqs,
          [&](const SeqRange& gap) { missing.first = std::min(missing.first, gap.first); });
    }
    if (missing.first > want.range.seqs.first) want.tries = 0;  // the holder answers
    want.range.seqs.first = missing.first;
    if (missing.first >= missing.end || want.tries >= kMaxTries) {
      wants_.erase(wants_.begin() + static_cast<std::ptrdiff_t>(i));
      continue;
    }
    if (now >= want.due) {
      std::array<std::byte, 40> body;
      ByteWriter writer{body};
      writer.varint(want.holder);
      std::size_t written = 0;
      const std::size_t head = writer.size();
      (void)write_ranges({&want.range, 1}, std::span{body}.subspan(head), written);
      if (!out.add(EntryKind::kRequest, std::span{body}.first(head + written))) return any;
      any = true;
      want.due = now + profile_.again * (3 + want.tries) / 4 + jitter(profile_.quick / 4);
      ++want.tries;
    }
    ++i;
  }
  return any;
}

bool ExchangeNode::write_digest_entry(DatagramWriter& out) noexcept {
  std::array<std::byte, kMaxDatagramBytes> body;
  std::size_t written = 0;
  const std::size_t room = std::min(out.room(), body.size());
  digest_after_ = write_digest(ledger_, digest_after_, std::span{body}.first(room), written);
  return written > 0 && out.add(EntryKind::kDigest, std::span{body}.first(written));
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
