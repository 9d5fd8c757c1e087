// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/sync/node.hpp"

#include <algorithm>

namespace maplet {

namespace {

constexpr Duration kFresh = std::chrono::seconds{60};   // a change is news for so long
constexpr Duration kNear = std::chrono::seconds{150};   // a peer unheard for longer is far away
constexpr Duration kAlive = std::chrono::seconds{600};  // and then gone
constexpr Duration kHeard = std::chrono::seconds{3};    // a peer that hears our digests now
constexpr int kRepeats = 2;
constexpr int kMostFlow = 25;  // of the quick intervals: then all is told, whatever flows

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
      ledger_{{config.max_lives}, self, arena},
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
      const bool old = now - news.due > 4 * profile_.again;  // digests tell of it
      if (!unconfirmed || old || news.left-- <= 0) {
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
  forget_owed();
  changed(now);
  woken_at_ = now;
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

// What was asked for by those who are gone: who comes now says what they lack.
void ExchangeNode::forget_owed() noexcept {
  for (Ranges& owed : owed_) {
    const auto end = std::remove_if(owed.begin(), owed.end(),
                                    [&](const KeyRange& range) { return range.life != self_; });
    owed.erase(end, owed.end());
  }
}

bool ExchangeNode::alone_with(const Peer& peer, Instant now) const noexcept {
  return std::ranges::none_of(peers_.all(), [&](const Peer& other) {
    return &other != &peer && !other.superseded && now - other.last_heard < kThere;
  });
}

// While they do, a digest would be out of date before it is read; their datagrams carry our word.
bool ExchangeNode::records_flow(Instant now) const noexcept {
  if (now - said_at_ > kMostFlow * profile_.quick) return false;
  return now - flow_at_ < profile_.quick / 2 ||
         std::ranges::any_of(owed_, [](const Ranges& owed) { return !owed.empty(); });
}

// Whoever is not there needs none; whose word is older than our own may hold the same by now.
bool ExchangeNode::digest_wanted(Instant now) const noexcept {
  if (small_digest()) return !all_in_sync(now);
  const bool overdue = now - digest_at_ > 5 * profile_.quick;
  const Instant calm_since = std::max(flow_at_, changed_at_) + profile_.quick / 8;
  return std::ranges::any_of(peers_.all(), [&](const Peer& peer) {
    return !peer.superseded && now - peer.last_heard < kThere && !in_sync(peer) &&
           (overdue || peer.word_at > calm_since);
  });
}

bool ExchangeNode::heard_within(std::uint16_t agent, Duration age, Instant now) const noexcept {
  return std::ranges::any_of(peers_.all(), [&](const Peer& peer) {
    return peer.life.agent == agent && !peer.superseded && now - peer.last_heard < age;
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
  // Those who are there hold the same; those who are not will call, too.
  const bool company = !lonely(now, kThere) && !recent_peer_behind(now, kThere);
  if (!small_digest() && company && recent_peer_behind(now, kAlive)) {
    return 8 * profile_.quick;
  }
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

}  // namespace maplet
